/* jacokin_ik.h: inverse kinematics of arms with six or seven turning joints, without Python.
 *
 * Every configuration of a six-joint arm at a pose, or all configurations with one free parameter: those of a
 * seven-joint arm at a pose, or of a six-joint arm whose tool may turn about an axis. C99, usable from C++11 on.
 *
 *     jacokin_ik_solver *solver;
 *     if (jacokin_ik_load("j2n6s300.jacokin", &solver) != JACOKIN_IK_OK) ...
 *     void *work = malloc(jacokin_ik_work_size(solver, JACOKIN_IK_POSES));
 *     double q[6];
 *     int status = jacokin_ik_nearest(solver, target, seed, work, size, q);
 *
 * The file is written by `jacokin export-c j2n6s300 --output DIR`: it holds the numbers of one arm, its frame, tool
 * and limits. The library has the same machine code as the Python package, and gives the same joint angles to the bit.
 *
 * UNITS AND SHAPES. Metres and radians. A pose is the 4x4 homogeneous matrix of the tool in the base, 16 doubles, row
 * by row, with 0 0 0 1 as its last row. A rotation that is orthonormal to 1e-6 is taken, and made exact; others are
 * refused. A configuration is one double for each joint, base to tip, as many as jacokin_ik_dof() says.
 *
 * SUCCESS. A configuration counts only if it is within every joint limit, exactly, and if the forward kinematics of
 * the very numbers that are returned meets the tolerances of the solver (1e-6 m and 1e-6 rad unless it was exported
 * with others). A joint past its limit by no more than 1e-9 rad is put on it, and measured again. Contact of the arm
 * with itself or with obstacles is not looked at.
 *
 * THREADS AND MEMORY. A solver is never changed once it is made: any number of threads may use it at a time. Each call
 * works in memory of the caller's, given as `work`: one piece for each thread. Calls allocate nothing, except those
 * that make a solver; they keep no state, lock nothing, print nothing, and raise no signals.
 *
 * BAD INPUT. A null pointer, a number that is not finite, too little memory or a damaged file is refused with a
 * negative code, and nothing is written but what the function says. A file is tried when it is loaded: one whose
 * numbers do not belong together finds none of eight configurations again, and is refused as damaged. On anything but
 * success a configuration is filled with NaN: it cannot be mistaken for an answer.
 */

#ifndef JACOKIN_IK_H
#define JACOKIN_IK_H

#include <stddef.h>

#ifdef __cplusplus
extern "C" {
#endif

#if defined(_WIN32) && defined(JACOKIN_IK_EXPORTS)
#define JACOKIN_IK_API __declspec(dllexport)
#elif defined(_WIN32)
#define JACOKIN_IK_API
#else
#define JACOKIN_IK_API __attribute__((visibility("default")))
#endif

/* Raised when a function or a structure of this header changes its meaning. */
#define JACOKIN_IK_ABI_VERSION 2

/* The most joints of an arm, and the most branches that a pose can have. */
#define JACOKIN_IK_MAX_DOF 7
#define JACOKIN_IK_MAX_BRANCHES 24
/* The most intervals that are found of a target; where it may have more, the set is not complete. */
#define JACOKIN_IK_MAX_INTERVALS 512

/* What became of a call: from 0 on about the target, below 0 about the call. jacokin_ik_status_text() has sentences. */
enum jacokin_ik_status {
    JACOKIN_IK_OK = 0,
    JACOKIN_IK_UNREACHABLE = 1,     /* no joint angles reach the pose, with or without limits */
    JACOKIN_IK_OUTSIDE_LIMITS = 2,  /* the pose can only be reached by breaking a joint limit */
    JACOKIN_IK_NO_CONVERGENCE = 3,  /* nothing was found, and it is not certain that there is nothing */
    JACOKIN_IK_BAD_ARGUMENT = -1,   /* a null pointer, an index or a value out of its range */
    JACOKIN_IK_NOT_FINITE = -2,     /* a number is NaN or infinite, or a seed farther than 1e6 rad from zero */
    JACOKIN_IK_NOT_RIGID = -3,      /* a target is not a rotation and a translation */
    JACOKIN_IK_WORK_TOO_SMALL = -4, /* the work memory is smaller than jacokin_ik_work_size() says */
    JACOKIN_IK_NO_ROOM = -5,        /* there are more answers than the caller's array holds */
    JACOKIN_IK_WRONG_ARM = -6,      /* the function is for arms with another number of joints */
    JACOKIN_IK_NO_FILE = -7,        /* the solver file cannot be read */
    JACOKIN_IK_DAMAGED_FILE = -8,   /* it is not a solver file, cut off, or changed */
    JACOKIN_IK_OTHER_VERSION = -9,  /* it is of another version of the format */
    JACOKIN_IK_NO_MEMORY = -10      /* there is no memory for a solver */
};

/* What work memory is for. */
enum jacokin_ik_task {
    JACOKIN_IK_POSES = 0,    /* jacokin_ik_all, _nearest and _batch */
    JACOKIN_IK_INTERVALS = 1 /* jacokin_ik_intervals, _at and _nearest_about, and everything else too */
};

/* Why an interval ends. */
enum jacokin_ik_end {
    JACOKIN_IK_END_LIMIT = 0,  /* a joint is on its limit */
    JACOKIN_IK_END_FOLD = 1,   /* two branches meet, and exist no further */
    JACOKIN_IK_END_RANGE = 2,  /* the range of the target ends */
    JACOKIN_IK_END_CIRCLE = 3, /* nothing ends: the curve goes on at the other end of the interval */
    JACOKIN_IK_END_LOST = 4    /* the curve could not be followed any further */
};

/* The numbers of one arm with its frame, tool, limits and tolerances. */
typedef struct jacokin_ik_solver jacokin_ik_solver;

/* One configuration that reaches a pose. */
typedef struct jacokin_ik_branch {
    double q[JACOKIN_IK_MAX_DOF]; /* [rad]; unlimited joints nearest to the seed, others within their limits if possible */
    double position_error;        /* [m], by forward kinematics of q */
    double orientation_error;     /* [rad] */
    double distance;              /* from the seed [rad], Euclidean */
    double margin;                /* to the nearest limit [rad]: negative outside, infinite without limits */
    int success;                  /* 1 where q is within every limit exactly, and within the tolerances */
    int singular;                 /* 1 where it stands for a whole curve: two axes of a spherical wrist on one line */
} jacokin_ik_branch;

/* An axis of the tool about which it may turn, by the right hand: T_base_tool = target * Rot(axis, p). */
typedef struct jacokin_ik_axis {
    double direction[3]; /* in the tool frame, through its origin; any length but 0 */
    double range[2];     /* least and largest p [rad]; -pi and pi for a full turn */
} jacokin_ik_axis;

/* Configurations on one branch for start <= p <= stop: each reaches the target, and is within the limits. The
 * parameter p [rad] is the angle about a free axis, or the joint of a seven-joint arm that jacokin_ik_parameter() names. */
typedef struct jacokin_ik_interval {
    double start;  /* [rad]; in [-pi, pi) where p may go full circle */
    double stop;   /* [rad]; at most start + 2 pi; start itself where the parameter stands still along the curve */
    int branch;    /* two intervals on one branch are parts of one curve */
    int ends[2];   /* why it ends at start and at stop: enum jacokin_ik_end */
    int joints[2]; /* index of the joint that is on its limit there; -1 for none */
    int piece;     /* for jacokin_ik_at: where the library keeps it */
    double shift;  /* for jacokin_ik_at: the curve's own parameter less p [rad] */
} jacokin_ik_interval;

/* The version of the library; it must be JACOKIN_IK_ABI_VERSION. */
JACOKIN_IK_API int jacokin_ik_abi_version(void);

/* What a status means and what to try, one sentence in English. Never null. */
JACOKIN_IK_API const char *jacokin_ik_status_text(int status);

/* --- Making a solver ------------------------------------------------------------------------------------------- */

/* Make a solver from a file that `jacokin export-c` wrote. *solver is null on anything but JACOKIN_IK_OK.
 * JACOKIN_IK_NO_FILE, _DAMAGED_FILE, _OTHER_VERSION, _NO_MEMORY, _BAD_ARGUMENT. WebAssembly has no files, and only the
 * next function. */
JACOKIN_IK_API int jacokin_ik_load(const char *path, jacokin_ik_solver **solver);

/* The same from the contents of such a file, of any alignment; they are copied. */
JACOKIN_IK_API int jacokin_ik_read(const void *contents, size_t size, jacokin_ik_solver **solver);

/* Give a solver's memory back; null is allowed. */
JACOKIN_IK_API void jacokin_ik_free(jacokin_ik_solver *solver);

/* Number of joints, 6 or 7; 0 for null. */
JACOKIN_IK_API int jacokin_ik_dof(const jacokin_ik_solver *solver);

/* Index of the joint that is the parameter of a seven-joint arm: 2 where it is built like a Jaco, else 0 or 6. -1 for six
 * joints and null. */
JACOKIN_IK_API int jacokin_ik_parameter(const jacokin_ik_solver *solver);

/* Names, of the solver's own memory: the robot, the base frame, the frame that is brought to a target, a joint. Empty
 * for null or an index that is out of range. */
JACOKIN_IK_API const char *jacokin_ik_robot(const jacokin_ik_solver *solver);
JACOKIN_IK_API const char *jacokin_ik_base(const jacokin_ik_solver *solver);
JACOKIN_IK_API const char *jacokin_ik_frame(const jacokin_ik_solver *solver);
JACOKIN_IK_API const char *jacokin_ik_joint_name(const jacokin_ik_solver *solver, int joint);

/* Limits [rad], infinite where a joint has none, and a configuration within them without contact. Each array holds
 * jacokin_ik_dof() doubles, and may be null. */
JACOKIN_IK_API int jacokin_ik_limits(const jacokin_ik_solver *solver, double *lower, double *upper, double *home);

/* Bytes of work memory that calls need, 90 kB for poses of six joints and 5 MB for curves; 0 for null. The memory must
 * be aligned as malloc() does, and need not be filled. */
JACOKIN_IK_API size_t jacokin_ik_work_size(const jacokin_ik_solver *solver, enum jacokin_ik_task task);

/* --- Forward kinematics ---------------------------------------------------------------------------------------- */

/* The pose of the tool in the base, 16 doubles, at a configuration; limits are not looked at.
 * JACOKIN_IK_NOT_FINITE, and the pose is left as it was, where a joint is NaN or infinite. */
JACOKIN_IK_API int jacokin_fk(const jacokin_ik_solver *solver, const double *q, double *pose);

/* --- Inverse kinematics ---------------------------------------------------------------------------------------- */

/* Every branch of a pose of a six-joint arm, nearest to the seed first, within the limits or not.
 *
 * target    16 doubles
 * seed      a configuration to stay near to, moved inside the limits where it is not; null for home
 * branches  filled; room for `capacity` of them, JACOKIN_IK_MAX_BRANCHES are always enough
 * count     how many there are; JACOKIN_IK_NO_ROOM where that is more than capacity, and the nearest ones are filled in
 * complete  0 where a branch may be missing, or one stands for a whole curve; may be null
 *
 * JACOKIN_IK_OK where one is a success, else _OUTSIDE_LIMITS, _UNREACHABLE, _NO_CONVERGENCE.
 * JACOKIN_IK_WRONG_ARM on seven joints: their poses have intervals. */
JACOKIN_IK_API int jacokin_ik_all(const jacokin_ik_solver *solver, const double *target, const double *seed, void *work,
                                  size_t work_size, jacokin_ik_branch *branches, int capacity, int *count,
                                  int *complete);

/* The configuration nearest to the seed that reaches a pose within the limits. On seven joints the work memory is that
 * for intervals. */
JACOKIN_IK_API int jacokin_ik_nearest(const jacokin_ik_solver *solver, const double *target, const double *seed,
                                      void *work, size_t work_size, double *q);

/* As jacokin_ik_nearest, for n targets.
 *
 * targets  n * 16 doubles
 * seeds    n * dof doubles; null for home
 * q        n * dof doubles, filled; NaN for a target that has no answer
 * status   n ints, filled: what jacokin_ik_nearest would return
 *
 * JACOKIN_IK_OK where the call itself could be done, whatever became of its targets. Where it could not, every status is
 * the code that is returned. */
JACOKIN_IK_API int jacokin_ik_batch(const jacokin_ik_solver *solver, size_t n, const double *targets,
                                    const double *seeds, void *work, size_t work_size, double *q, int *status);

/* --- One free parameter ---------------------------------------------------------------------------------------- */

/* All configurations within the limits that reach a target with one free parameter, as intervals of it.
 *
 * about      six joints: the axis about which the tool may turn; seven joints: null
 * intervals  filled, by branch and start; room for `capacity` of them
 * count      how many there are; JACOKIN_IK_NO_ROOM where that is more than capacity, and the first ones are filled in
 * complete   0 where something may be missing; may be null
 *
 * What the kernels find is given as it is. Where the configurations of a target are singular in several ways at once,
 * they may lose a curve: complete is 0 then.
 *
 * JACOKIN_IK_OK where there is an interval, else _OUTSIDE_LIMITS, _UNREACHABLE, _NO_CONVERGENCE. */
JACOKIN_IK_API int jacokin_ik_intervals(const jacokin_ik_solver *solver, const double *target,
                                        const jacokin_ik_axis *about, void *work, size_t work_size,
                                        jacokin_ik_interval *intervals, int capacity, int *count, int *complete);

/* The configuration of an interval where the parameter has a value.
 *
 * work      what jacokin_ik_intervals() left there: no other call may have used it meanwhile but this one
 * interval  one that it gave
 * p         from start to stop, or whole turns away [rad]
 * seed      joints take the 2 pi equivalent within their limits that is nearest to it; null for home
 *
 * JACOKIN_IK_NO_CONVERGENCE where the point found does not reach the target within the limits. */
JACOKIN_IK_API int jacokin_ik_at(const jacokin_ik_solver *solver, void *work, size_t work_size,
                                 const jacokin_ik_interval *interval, double p, const double *seed, double *q);

/* The configuration nearest to the seed on all intervals, as jacokin_ik_nearest, and its parameter.
 *
 * about      as for jacokin_ik_intervals()
 * parameter  where it is [rad]: the angle about a free axis, in its range; or the joint itself. May be null */
JACOKIN_IK_API int jacokin_ik_nearest_about(const jacokin_ik_solver *solver, const double *target,
                                            const jacokin_ik_axis *about, const double *seed, void *work,
                                            size_t work_size, double *q, double *parameter);

#ifdef __cplusplus
}
#endif

#endif
