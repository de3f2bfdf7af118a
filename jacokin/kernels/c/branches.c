/* Every branch of a pose of a six-joint arm, and the nearest one within the limits. */

#include <string.h>

#include "common.h"

int jacokin_find_branches(const jacokin_ik_solver *solver, const double *T, const double *seed, entry *table,
                          int *dropped) {
    memcpy(table[TARGETS_chain].numbers, solver->six, 7 * 12 * sizeof(double));
    memcpy(table[TARGETS_arm].numbers, solver->constants, CONSTANTS_SIX * sizeof(double));
    memcpy(table[TARGETS_limits].numbers, solver->limits, sizeof solver->limits);
    memcpy(table[TARGETS_T].numbers, T, 16 * sizeof(double));
    memcpy(table[TARGETS_seed].numbers, seed, 6 * sizeof(double));
    table[TARGETS_best_length].length = table[TARGETS_nearest_length].length = 0; /* all, nearest to the seed first */
    int64_t count = jacokin_solve_targets_chosen(table);
    *dropped = count < 0; /* a table of the kernels was full: the count is its complement */
    if (count < 0) count = ~count;
    return count <= JACOKIN_IK_MAX_BRANCHES ? (int)count : 0;
}

/* The status where no branch is a success. */
static int why_not(int count, int dropped, const double *rows) {
    if (dropped) return JACOKIN_IK_NO_CONVERGENCE;
    for (int i = 0; i < count; i++)
        if (rows[i * JACOKIN_COLUMNS + JACOKIN_WITHIN_LIMITS] == 1.0) return JACOKIN_IK_NO_CONVERGENCE;
    return count == 0 ? JACOKIN_IK_UNREACHABLE : JACOKIN_IK_OUTSIDE_LIMITS;
}

int jacokin_ik_all(const jacokin_ik_solver *solver, const double *target, const double *seed, void *work,
                   size_t work_size, jacokin_ik_branch *branches, int capacity, int *count, int *complete) {
    if (solver == NULL || target == NULL || count == NULL || capacity < 0 || (branches == NULL && capacity > 0))
        return JACOKIN_IK_BAD_ARGUMENT;
    *count = 0;
    if (complete != NULL) *complete = 0;
    if (solver->dof != 6) return JACOKIN_IK_WRONG_ARM;
    layout memory;
    double T[16], start[JACOKIN_IK_MAX_DOF];
    int status = jacokin_lay_out(solver, work, work_size, JACOKIN_IK_POSES, &memory);
    if (status == JACOKIN_IK_OK) status = jacokin_read_target(target, T);
    if (status == JACOKIN_IK_OK) status = jacokin_read_seed(solver, seed, start);
    if (status != JACOKIN_IK_OK) return status;

    int dropped, successes = 0, singular = 0;
    *count = jacokin_find_branches(solver, T, start, memory.targets, &dropped);
    const double *rows = memory.targets[TARGETS_pose_branches_rows].numbers;
    for (int i = 0; i < *count; i++) {
        const double *row = &rows[i * JACOKIN_COLUMNS];
        double errors[2];
        int success = jacokin_reaches(solver, T, row, errors);
        successes += success;
        singular |= row[JACOKIN_FAMILY] == 1.0;
        if (i >= capacity) continue;
        jacokin_ik_branch *branch = &branches[i];
        memcpy(branch->q, row, 6 * sizeof(double));
        branch->q[6] = 0.0;
        branch->position_error = errors[0];
        branch->orientation_error = errors[1];
        branch->distance = row[JACOKIN_DISTANCE];
        branch->margin = row[6];
        for (int j = 7; j < 12; j++) branch->margin = fmin(branch->margin, row[j]);
        branch->success = success;
        branch->singular = row[JACOKIN_FAMILY] == 1.0;
    }
    if (complete != NULL) *complete = !dropped && !singular;
    if (*count > capacity) return JACOKIN_IK_NO_ROOM;
    return successes > 0 ? JACOKIN_IK_OK : why_not(*count, dropped, rows);
}

/* The nearest branch that is a success, of a target and a seed that were checked. */
static int nearest_branch(const jacokin_ik_solver *solver, const double *T, const double *seed, entry *table,
                          double *q) {
    int dropped, count = jacokin_find_branches(solver, T, seed, table, &dropped);
    const double *rows = table[TARGETS_pose_branches_rows].numbers;
    for (int i = 0; i < count; i++) {
        const double *row = &rows[i * JACOKIN_COLUMNS];
        if (jacokin_reaches(solver, T, row, NULL)) {
            memcpy(q, row, 6 * sizeof(double));
            return JACOKIN_IK_OK;
        }
    }
    return jacokin_no_answer(solver, q, why_not(count, dropped, rows));
}

/* One target of a solver whose work memory is laid out. */
static int nearest(const jacokin_ik_solver *solver, const double *target, const double *seed, layout *memory,
                   double *q) {
    double T[16], start[JACOKIN_IK_MAX_DOF];
    int status = jacokin_read_target(target, T);
    if (status == JACOKIN_IK_OK) status = jacokin_read_seed(solver, seed, start);
    if (status != JACOKIN_IK_OK) return jacokin_no_answer(solver, q, status);
    if (solver->dof == 7) return jacokin_nearest_on_curves(solver, T, start, memory, q);
    return nearest_branch(solver, T, start, memory->targets, q);
}

int jacokin_ik_nearest(const jacokin_ik_solver *solver, const double *target, const double *seed, void *work,
                       size_t work_size, double *q) {
    if (solver == NULL || q == NULL) return JACOKIN_IK_BAD_ARGUMENT;
    layout memory;
    int status = target == NULL ? JACOKIN_IK_BAD_ARGUMENT
                                : jacokin_lay_out(solver, work, work_size, JACOKIN_IK_POSES, &memory);
    if (status != JACOKIN_IK_OK) return jacokin_no_answer(solver, q, status);
    return nearest(solver, target, seed, &memory, q);
}

int jacokin_ik_batch(const jacokin_ik_solver *solver, size_t n, const double *targets, const double *seeds, void *work,
                     size_t work_size, double *q, int *status) {
    if (solver == NULL || (n > 0 && (q == NULL || status == NULL))) return JACOKIN_IK_BAD_ARGUMENT;
    layout memory;
    int laid_out = n > 0 && targets == NULL ? JACOKIN_IK_BAD_ARGUMENT
                                            : jacokin_lay_out(solver, work, work_size, JACOKIN_IK_POSES, &memory);
    size_t dof = (size_t)solver->dof;
    if (laid_out != JACOKIN_IK_OK) {
        for (size_t i = 0; i < n; i++) status[i] = jacokin_no_answer(solver, q + dof * i, laid_out);
        return laid_out;
    }
    for (size_t i = 0; i < n; i++)
        status[i] = nearest(solver, targets + 16 * i, seeds == NULL ? NULL : seeds + dof * i, &memory, q + dof * i);
    return JACOKIN_IK_OK;
}
