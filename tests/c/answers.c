/* What the library answers on a machine, for a comparison with another one.
 *
 *     answers FILE POSES
 *
 * POSES holds 16 doubles a pose. Prints, for each, the status and joints of every branch of six joints, or of the middle of
 * every interval of seven, with 17 digits.
 */

#include <stdio.h>
#include <stdlib.h>

#include "jacokin_ik.h"

static void print(int dof, const double *q) {
    for (int j = 0; j < dof; j++) printf(" %.17g", q[j]);
    printf("\n");
}

int main(int argc, char **argv) {
    jacokin_ik_solver *solver;
    double T[16], q[JACOKIN_IK_MAX_DOF];
    int status = jacokin_ik_load(argc > 2 ? argv[1] : "", &solver), count, complete;
    FILE *poses = argc > 2 ? fopen(argv[2], "rb") : NULL;
    if (status != JACOKIN_IK_OK || poses == NULL) {
        fprintf(stderr, "%s\n", jacokin_ik_status_text(status));
        return 1;
    }
    int dof = jacokin_ik_dof(solver);
    size_t size = jacokin_ik_work_size(solver, JACOKIN_IK_INTERVALS);
    void *work = malloc(size);
    while (work != NULL && fread(T, sizeof T, 1, poses) == 1) {
        if (dof == 6) {
            jacokin_ik_branch found[JACOKIN_IK_MAX_BRANCHES];
            status = jacokin_ik_all(solver, T, NULL, work, size, found, JACOKIN_IK_MAX_BRANCHES, &count, &complete);
            printf("%d %d %d\n", status, count, complete);
            for (int i = 0; i < count; i++) print(dof, found[i].q);
        } else {
            static jacokin_ik_interval found[JACOKIN_IK_MAX_INTERVALS];
            status = jacokin_ik_intervals(solver, T, NULL, work, size, found, JACOKIN_IK_MAX_INTERVALS, &count, &complete);
            printf("%d %d %d\n", status, count, complete);
            for (int i = 0; i < count; i++) {
                double middle = 0.5 * (found[i].start + found[i].stop);
                if (jacokin_ik_at(solver, work, size, &found[i], middle, NULL, q) != JACOKIN_IK_OK) q[0] = -1e9;
                print(dof, q);
            }
        }
    }
    free(work);
    jacokin_ik_free(solver);
    fclose(poses);
    return 0;
}
