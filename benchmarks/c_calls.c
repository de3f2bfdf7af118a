/* Times of the C library's calls, for benchmarks/c_calls.py.
 *
 *     c_calls FILE TARGETS ROUNDS
 *
 * FILE is a solver's, TARGETS holds poses of 16 doubles each. Prints seconds a pose, of the best round: nearest, and on
 * six joints all.
 */

#define _POSIX_C_SOURCE 200112L

#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#include "jacokin_ik.h"

static double now(void) {
    struct timespec time;
    clock_gettime(CLOCK_MONOTONIC, &time);
    return (double)time.tv_sec + 1e-9 * (double)time.tv_nsec;
}

int main(int argc, char **argv) {
    jacokin_ik_solver *solver;
    if (argc != 4 || jacokin_ik_load(argv[1], &solver) != JACOKIN_IK_OK) return 2;
    FILE *file = fopen(argv[2], "rb");
    if (file == NULL || fseek(file, 0, SEEK_END) != 0) return 2;
    size_t n = (size_t)ftell(file) / (16 * sizeof(double)), size = jacokin_ik_work_size(solver, JACOKIN_IK_POSES);
    double *targets = malloc(n * 16 * sizeof(double)), best[2] = {1e9, 1e9}, q[JACOKIN_IK_MAX_DOF];
    void *work = malloc(size);
    rewind(file);
    if (targets == NULL || work == NULL || fread(targets, 16 * sizeof(double), n, file) != n) return 2;
    fclose(file);
    int six = jacokin_ik_dof(solver) == 6, count, complete;
    jacokin_ik_branch branches[JACOKIN_IK_MAX_BRANCHES];
    for (int round = 0; round < atoi(argv[3]); round++)
        for (int which = 0; which < (six ? 2 : 1); which++) {
            double start = now();
            for (size_t i = 0; i < n; i++) {
                const double *T = targets + 16 * i;
                int status = which == 0 ? jacokin_ik_nearest(solver, T, NULL, work, size, q)
                                        : jacokin_ik_all(solver, T, NULL, work, size, branches, JACOKIN_IK_MAX_BRANCHES,
                                                         &count, &complete);
                if (status < 0) return 2;
            }
            double seconds = (now() - start) / (double)n;
            if (seconds < best[which]) best[which] = seconds;
        }
    printf(six ? "%.9g %.9g\n" : "%.9g\n", best[0], best[1]);
    free(work);
    free(targets);
    jacokin_ik_free(solver);
    return 0;
}
