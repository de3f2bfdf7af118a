//! Solve a pose of a Jaco in Rust, through the C library and without a crate.
//!
//!     jacokin export-c j2n6s300 --output arm
//!     rustc nearest.rs -L arm/lib -C link-arg=-Wl,-rpath,arm/lib -o nearest
//!     ./nearest arm/j2n6s300.jacokin

use std::ffi::{c_char, c_int, c_void, CStr, CString};

#[link(name = "jacokin")]
extern "C" {
    fn jacokin_ik_load(path: *const c_char, solver: *mut *mut c_void) -> c_int;
    fn jacokin_ik_free(solver: *mut c_void);
    fn jacokin_ik_work_size(solver: *const c_void, task: c_int) -> usize;
    fn jacokin_ik_status_text(status: c_int) -> *const c_char;
    fn jacokin_ik_nearest(
        solver: *const c_void,
        target: *const f64, // 16: the pose of the tool in the base, row by row [m]
        seed: *const f64,   // null for home
        work: *mut c_void,
        work_size: usize,
        q: *mut f64, // 7 at most [rad]
    ) -> c_int;
}

fn main() {
    let path = std::env::args().nth(1).unwrap_or("j2n6s300.jacokin".into());
    let path = CString::new(path).expect("a path has no zero");
    let target = [1., 0., 0., 0.3, 0., -1., 0., -0.2, 0., 0., -1., 0.5, 0., 0., 0., 1.];
    let (mut solver, mut q) = (std::ptr::null_mut(), [f64::NAN; 7]);
    // Safe: the solver is freed once and not used afterwards; the work memory is as long as the library asks for.
    let (status, text) = unsafe {
        let mut status = jacokin_ik_load(path.as_ptr(), &mut solver);
        if status == 0 {
            let mut work = vec![0u64; jacokin_ik_work_size(solver, 0) / 8];
            let memory = work.as_mut_ptr().cast();
            status = jacokin_ik_nearest(solver, target.as_ptr(), std::ptr::null(), memory, work.len() * 8, q.as_mut_ptr());
        }
        jacokin_ik_free(solver);
        (status, CStr::from_ptr(jacokin_ik_status_text(status)).to_string_lossy())
    };
    println!("{text}");
    if status == 0 {
        println!("{:?} rad", &q[..6]);
    }
    std::process::exit(i32::from(status != 0));
}
