/* Kernels that are there a second time on x86-64, with AVX2's vectors of four numbers: which of both to run.
 *
 * Both do the same operations in the same order and give the same bits. Other processors have one, of that name.
 */

#include "common.h"

#if defined(__x86_64__)

#include <cpuid.h>

int64_t jacokin_solve_targets_avx2(entry *table);

/* Whether the processor has these vectors, and the system keeps them for each program. */
static int has_avx2(void) {
    unsigned a, b, c, d, kept, high;
    if (!__get_cpuid(1, &a, &b, &c, &d) || !(c >> 27 & 1)) return 0; /* whether kept may be asked for */
    __asm__("xgetbv" : "=a"(kept), "=d"(high) : "c"(0));
    if ((kept & 6) != 6) return 0; /* both halves of the registers */
    return __get_cpuid_count(7, 0, &a, &b, &c, &d) && (b >> 5 & 1);
}

int jacokin_is_wide(void) {
    static volatile int wide = -1; /* threads that ask at the same time find the same */
    if (wide < 0) wide = has_avx2();
    return wide;
}

int64_t jacokin_solve_targets_chosen(entry *table) {
    return jacokin_is_wide() ? jacokin_solve_targets_avx2(table) : jacokin_solve_targets(table);
}

#else

int jacokin_is_wide(void) { return 0; }

int64_t jacokin_solve_targets_chosen(entry *table) { return jacokin_solve_targets(table); }

#endif
