/* Solve a pose of a Jaco in C: the nearest configuration within the limits, and every branch.
 *
 *     jacokin export-c j2n6s300 --output arm
 *     cc nearest.c -Iarm/include arm/lib/libjacokin.so -lm -Wl,-rpath,arm/lib -o nearest
 *     ./nearest arm/j2n6s300.jacokin
 */

#include <stdio.h>
#include <stdlib.h>

#include "jacokin_ik.h"

int main(int argc, char **argv) {
    jacokin_ik_solver *solver;
    int status = jacokin_ik_load(argc > 1 ? argv[1] : "j2n6s300.jacokin", &solver);
    if (status != JACOKIN_IK_OK) {
        fprintf(stderr, "%s\n", jacokin_ik_status_text(status));
        return 1;
    }
    /* The tool 0.5 m above the table, pointing down [m]. */
    const double target[16] = {1, 0, 0, 0.3, /**/ 0, -1, 0, -0.2, /**/ 0, 0, -1, 0.5, /**/ 0, 0, 0, 1};
    double q[JACOKIN_IK_MAX_DOF];
    size_t size = jacokin_ik_work_size(solver, JACOKIN_IK_POSES);
    void *work = malloc(size); /* one for each thread; solving allocates nothing */

    status = jacokin_ik_nearest(solver, target, NULL, work, size, q);
    printf("%s: %s\n", jacokin_ik_robot(solver), jacokin_ik_status_text(status));
    if (status == JACOKIN_IK_OK) {
        for (int j = 0; j < jacokin_ik_dof(solver); j++) printf("%s %.6f rad\n", jacokin_ik_joint_name(solver, j), q[j]);
    }

    jacokin_ik_branch branches[JACOKIN_IK_MAX_BRANCHES];
    int count = 0;
    if (jacokin_ik_all(solver, target, NULL, work, size, branches, JACOKIN_IK_MAX_BRANCHES, &count, NULL) >= 0) {
        for (int i = 0; i < count; i++)
            printf("branch %d: %s, %.3f rad from the nearest limit, %.3f rad from home\n", i + 1,
                   branches[i].success ? "within the limits" : "outside", branches[i].margin, branches[i].distance);
    }
    free(work);
    jacokin_ik_free(solver);
    return status == JACOKIN_IK_OK ? 0 : 1;
}
