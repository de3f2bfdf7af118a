/* Mathematics by the oldest names that the GNU C library has for it.
 *
 * hypot, exp, log and pow have newer versions there, which differ in how they report errors only. A library linked
 * against those, as the system's compiler does, asks for GLIBC 2.35 and does not load on older systems. The linker is
 * told to lead the kernels' calls here (--wrap).
 */

#include <features.h>

double __real_hypot(double x, double y);
double __real_exp(double x);
double __real_log(double x);
double __real_pow(double x, double y);

#if defined(__GLIBC__) && defined(__x86_64__)
__asm__(".symver __real_hypot, hypot@GLIBC_2.2.5");
__asm__(".symver __real_exp, exp@GLIBC_2.2.5");
__asm__(".symver __real_log, log@GLIBC_2.2.5");
__asm__(".symver __real_pow, pow@GLIBC_2.2.5");
#elif defined(__GLIBC__) && defined(__aarch64__)
__asm__(".symver __real_hypot, hypot@GLIBC_2.17");
__asm__(".symver __real_exp, exp@GLIBC_2.17");
__asm__(".symver __real_log, log@GLIBC_2.17");
__asm__(".symver __real_pow, pow@GLIBC_2.17");
#endif

double __wrap_hypot(double x, double y) { return __real_hypot(x, y); }
double __wrap_exp(double x) { return __real_exp(x); }
double __wrap_log(double x) { return __real_log(x); }
double __wrap_pow(double x, double y) { return __real_pow(x, y); }
