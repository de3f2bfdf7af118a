#include "common.h"
int jacokin_nearest_member(const jacokin_ik_solver *solver, const double *T, const double *seed, layout *memory,
                           double *q) { (void)T; (void)seed; (void)memory; return jacokin_no_answer(solver, q, JACOKIN_IK_NO_CONVERGENCE); }
