/* Every function of the library on many targets, from several threads at a time; for sanitizers and strict compilers.
 *
 *     exercise FILE TARGETS THREADS
 *
 * Prints a line of sums for each thread: all the same, as all do the same. C11 threads are not everywhere: POSIX.
 */

#define _POSIX_C_SOURCE 200112L

#include <math.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "jacokin_ik.h"

static jacokin_ik_solver *solver;
static int targets;
static double sums[64];

/* A number from 0 to 1 that follows from a state, the same for every thread. */
static double next(unsigned long *state) {
    *state = (*state * 1103515245UL + 12345UL) & 0x7fffffffUL;
    return (double)*state / 0x7fffffff;
}

static void fail(const char *what, int status) {
    fprintf(stderr, "%s: %s\n", what, jacokin_ik_status_text(status));
    exit(1);
}

/* Whether a pose and a target agree to 1e-6. */
static int agree(const double *a, const double *b) {
    for (int i = 0; i < 16; i++)
        if (!(fabs(a[i] - b[i]) < 1e-6)) return 0;
    return 1;
}

static void *work_through(void *argument) {
    const jacokin_ik_axis axis = {{0.3, 1.0, 0.0}, {-1.0, 1.5}}, *about = NULL;
    size_t size = jacokin_ik_work_size(solver, JACOKIN_IK_INTERVALS);
    int dof = jacokin_ik_dof(solver), count, complete;
    double *sum = argument, lower[JACOKIN_IK_MAX_DOF], upper[JACOKIN_IK_MAX_DOF];
    unsigned long state = 1;
    void *work = malloc(size);
    if (work == NULL) fail("malloc", JACOKIN_IK_NO_MEMORY);
    memset(work, 0xff, size); /* the library fills in what it reads */
    jacokin_ik_limits(solver, lower, upper, NULL);
    if (dof == 6) about = &axis;
    for (int n = 0; n < targets; n++) {
        double q[JACOKIN_IK_MAX_DOF], answer[JACOKIN_IK_MAX_DOF], T[16], reached[16], parameter;
        jacokin_ik_branch branches[JACOKIN_IK_MAX_BRANCHES];
        jacokin_ik_interval intervals[64];
        for (int j = 0; j < dof; j++) q[j] = 6.28 * next(&state);
        jacokin_fk(solver, q, T);
        if (n % 4 == 0) T[3] += 0.2;
        int status = jacokin_ik_nearest(solver, T, q, work, size, answer);
        if (status < 0) fail("nearest", status);
        if (status == JACOKIN_IK_OK) {
            jacokin_fk(solver, answer, reached);
            for (int j = 0; j < dof; j++)
                if (!(lower[j] <= answer[j] && answer[j] <= upper[j])) fail("limits", status);
            if (!agree(reached, T)) fail("agree", status);
            for (int j = 0; j < dof; j++) *sum += answer[j];
        }
        if (dof == 6) {
            status = jacokin_ik_all(solver, T, q, work, size, branches, JACOKIN_IK_MAX_BRANCHES, &count, &complete);
            if (status < 0) fail("all", status);
            *sum += count;
        }
        status = jacokin_ik_intervals(solver, T, about, work, size, intervals, 64, &count, &complete);
        if (status < 0) fail("intervals", status);
        for (int i = 0; i < count; i++)
            for (int k = 0; k <= 4; k++) {
                double p = intervals[i].start + 0.25 * k * (intervals[i].stop - intervals[i].start);
                status = jacokin_ik_at(solver, work, size, &intervals[i], p, q, answer);
                if (status != JACOKIN_IK_OK) fail("at", status);
                *sum += answer[0];
            }
        status = jacokin_ik_nearest_about(solver, T, about, q, work, size, answer, &parameter);
        if (status < 0) fail("nearest about", status);
        if (status == JACOKIN_IK_OK) *sum += parameter;
    }
    free(work);
    return NULL;
}

int main(int argc, char **argv) {
    if (argc != 4 || jacokin_ik_abi_version() != JACOKIN_IK_ABI_VERSION) return 2;
    int status = jacokin_ik_load(argv[1], &solver), threads = atoi(argv[3]);
    if (status != JACOKIN_IK_OK) fail(argv[1], status);
    pthread_t running[64];
    targets = atoi(argv[2]);
    for (int i = 0; i < threads; i++)
        if (pthread_create(&running[i], NULL, work_through, &sums[i]) != 0) return 2;
    for (int i = 0; i < threads; i++) pthread_join(running[i], NULL);
    for (int i = 0; i < threads; i++) printf("%.17g\n", sums[i]);
    jacokin_ik_free(solver);
    return 0;
}
