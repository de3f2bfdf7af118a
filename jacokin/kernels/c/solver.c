/* A solver from its file, what it knows, the layout of work memory, and forward kinematics. */

#include <float.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "common.h"

/* --- Statuses -------------------------------------------------------------------------------------------------- */

int jacokin_ik_abi_version(void) { return JACOKIN_IK_ABI_VERSION; }

const char *jacokin_ik_status_text(int status) {
    switch (status) {
        case JACOKIN_IK_OK:
            return "the pose is reached within the tolerances and every joint is inside its limits";
        case JACOKIN_IK_UNREACHABLE:
            return "no joint angles reach this pose, with or without limits: move the target closer to the arm, "
                   "or let the tool turn about an axis";
        case JACOKIN_IK_OUTSIDE_LIMITS:
            return "the pose can only be reached by breaking a joint limit: turn or shift the target, "
                   "or export the solver with wider limits if your arm allows them";
        case JACOKIN_IK_NO_CONVERGENCE:
            return "nothing was found, and it is not certain that there is nothing: turn or shift the target a little, "
                   "export the solver with larger tolerances, or ask the Python package, which searches further";
        case JACOKIN_IK_BAD_ARGUMENT:
            return "an argument is a null pointer or out of its range: see what the header says about it";
        case JACOKIN_IK_NOT_FINITE:
            return "a number is NaN, infinite, or an angle more than 1e6 rad from zero: check what computed it";
        case JACOKIN_IK_NOT_RIGID:
            return "a target is not a rotation and a translation: give 16 numbers row by row, the last row 0 0 0 1";
        case JACOKIN_IK_WORK_TOO_SMALL:
            return "the work memory is too small: give as many bytes as jacokin_ik_work_size() says";
        case JACOKIN_IK_NO_ROOM:
            return "there are more answers than the array holds: give room for as many as the header says";
        case JACOKIN_IK_WRONG_ARM:
            return "this function is not for an arm with so many joints: see what the header says about it";
        case JACOKIN_IK_NO_FILE:
            return "the solver file cannot be read: write it with `jacokin export-c`";
        case JACOKIN_IK_DAMAGED_FILE:
            return "the solver file is damaged or incomplete: write it again with `jacokin export-c`";
        case JACOKIN_IK_OTHER_VERSION:
            return "the solver file is of another version than the library: write it again with `jacokin export-c`";
        case JACOKIN_IK_NO_MEMORY:
            return "there is no memory for the solver: free some";
        default:
            return "this is not a status of jacokin";
    }
}

/* --- The file -------------------------------------------------------------------------------------------------- */

/* Numbers are little-endian, doubles IEEE 754:
 *
 *     8 bytes     "jacokin", and a zero
 *     4 uint32    version of the format, number of joints, kind, bytes of text
 *     doubles     chain, constants (of six joints, or of seven built like a Jaco's), lower and
 *                 upper limits, home, snap, tolerances of position and orientation
 *     text        names in UTF-8, each ended by a zero: robot, base, frame, joints
 *     uint64      FNV-1a of everything before
 *
 * The kind says which of seven angles is the parameter: 0 the last one (always so of six joints), 1 the first one, 2
 * joint 3 of seven joints built like a Jaco's.
 */
enum { FILE_VERSION = 3, FILE_HEADER = 24, FILE_CHECK = 8, MAX_FILE = 65536 };

/* [-] A placement's rotation is orthonormal to this, or the file is not what was written. */
static const double ROTATION_SLACK = 1e-6;
/* [rad] A joint is put on its limit from no farther away. */
static const double LARGEST_SNAP = 1e-3;
/* Configurations that are tried, of which one must be found again; none is on an arm that cannot move in all directions. */
enum { TRIALS = 8 };
/* [rad] A joint that is found again. */
static const double SAME_JOINT = 1e-4;
/* [m] No link is longer, and no constant of the mechanism larger than the square of that. */
static const double LONGEST = 1e6;
/* [rad] Farther from zero a double no longer resolves an angle to 1e-10. */
static const double FARTHEST = 1e6;

static uint64_t read_unsigned(const unsigned char *bytes, int size) {
    uint64_t value = 0;
    for (int i = size - 1; i >= 0; i--) value = value << 8 | bytes[i];
    return value;
}

static const unsigned char *read_doubles(const unsigned char *bytes, int count, double *values) {
    for (int i = 0; i < count; i++, bytes += 8) {
        uint64_t bits = read_unsigned(bytes, 8);
        memcpy(&values[i], &bits, 8);
    }
    return bytes;
}

static uint64_t check_sum(const unsigned char *bytes, size_t size) {
    uint64_t hash = UINT64_C(14695981039346656037);
    for (size_t i = 0; i < size; i++) hash = (hash ^ bytes[i]) * UINT64_C(1099511628211);
    return hash;
}

static int all_within(const double *values, int count, double bound) {
    for (int i = 0; i < count; i++)
        if (!(fabs(values[i]) <= bound)) return 0;
    return 1;
}

static int all_finite(const double *values, int count) { return all_within(values, count, DBL_MAX); }

static int is_limit(double value) { return isinf(value) || fabs(value) <= FARTHEST; }

/* The largest entry of R^T R - I, for a rotation in rows of so many doubles. */
static double misfit_of(const double *R, int stride) {
    double worst = 0.0;
    for (int i = 0; i < 3; i++)
        for (int j = i; j < 3; j++) {
            double product = R[i] * R[j] + R[stride + i] * R[stride + j] + R[2 * stride + i] * R[2 * stride + j];
            worst = fmax(worst, fabs(product - (i == j ? 1.0 : 0.0)));
        }
    return worst;
}

static double determinant_of(const double *R, int stride) {
    const double *a = R, *b = R + stride, *c = R + 2 * stride;
    return a[0] * (b[1] * c[2] - b[2] * c[1]) - a[1] * (b[0] * c[2] - b[2] * c[0]) +
           a[2] * (b[0] * c[1] - b[1] * c[0]);
}

static int constants_of(int kind) { return kind == JACOKIN_JOINT_3 ? CONSTANTS_SEVEN : CONSTANTS_SIX; }

/* Whether the numbers are those of an arm: no kernel is given others. */
static int makes_sense(const jacokin_ik_solver *solver) {
    if (!all_within(solver->chain, (solver->dof + 1) * 12, LONGEST) ||
        !all_within(solver->constants, constants_of(solver->kind), LONGEST * LONGEST) || !all_within(solver->home, solver->dof, FARTHEST))
        return 0;
    for (int i = 0; i <= solver->dof; i++)
        if (!(misfit_of(&solver->chain[12 * i], 4) <= ROTATION_SLACK) || determinant_of(&solver->chain[12 * i], 4) < 0.0)
            return 0;
    for (int j = 0; j < solver->dof; j++)
        if (!(solver->lower[j] <= solver->home[j] && solver->home[j] <= solver->upper[j]) ||
            !is_limit(solver->lower[j]) || !is_limit(solver->upper[j]))
            return 0;
    return solver->snap >= 0.0 && solver->snap <= LARGEST_SNAP && solver->position_tolerance > 0.0 &&
           isfinite(solver->position_tolerance) && solver->orientation_tolerance > 0.0 &&
           isfinite(solver->orientation_tolerance);
}

/* Fill the chain of the arm from its tool to its base. Half a turn about x between its joints lets them turn the same
 * way as they do. */
static void turn_round(const double *chain, int joints, double *turned) {
    for (int i = 0; i <= joints; i++) {
        double *C = &turned[12 * i];
        jacokin_invert(&chain[12 * (joints - i)], C);
        for (int row = 0; row < 3; row++)
            for (int column = 0; column < 4; column++) {
                int turns = (row > 0 && i > 0) + (column % 3 > 0 && i < joints);
                if (turns == 1) C[4 * row + column] = -C[4 * row + column];
            }
    }
}

/* Whether q is among the branches of its pose. */
static int finds_branch(const jacokin_ik_solver *solver, const double *q, const layout *memory) {
    double T[16];
    jacokin_forward(solver->six, 6, q, T);
    int dropped, count = jacokin_find_branches(solver, T, solver->home, memory->targets, &dropped);
    const double *rows = memory->targets[TARGETS_pose_branches_rows].numbers;
    for (int i = 0; i < count; i++) {
        int same = 1;
        for (int j = 0; j < 6; j++) {
            double away = rows[i * JACOKIN_COLUMNS + j] - q[j];
            same = same && fabs(away - TURN * rint(away / TURN)) <= SAME_JOINT;
        }
        if (same) return 1;
    }
    return 0;
}

/* Whether the pose of q has curves, within the limits or not. */
static int finds_curves(const jacokin_ik_solver *solver, const double *q, void *work, size_t size) {
    double T[16];
    int count;
    jacokin_forward(solver->chain, solver->dof, q, T);
    int status = jacokin_ik_intervals(solver, T, NULL, work, size, NULL, 0, &count, NULL);
    return status == JACOKIN_IK_NO_ROOM || status == JACOKIN_IK_OUTSIDE_LIMITS;
}

/* Whether the closed form finds one of some configurations again: with constants that are not those of the chain it
 * finds nothing, and searches long for it. JACOKIN_IK_DAMAGED_FILE, JACOKIN_IK_NO_MEMORY. */
static int finds_itself(const jacokin_ik_solver *solver) {
    size_t size = jacokin_ik_work_size(solver, JACOKIN_IK_POSES);
    void *work = malloc(size);
    layout memory;
    if (work == NULL) return JACOKIN_IK_NO_MEMORY;
    int status = jacokin_lay_out(solver, work, size, JACOKIN_IK_POSES, &memory);
    int found = 0;
    for (int trial = 0; trial < TRIALS && status == JACOKIN_IK_OK && !found; trial++) {
        double q[JACOKIN_IK_MAX_DOF];
        for (int j = 0; j < JACOKIN_IK_MAX_DOF; j++) { /* spread evenly by the golden ratio */
            double share = 0.6180339887498949 * (6 * trial + j + 1);
            q[j] = TURN * (share - floor(share)) - PI;
        }
        found = solver->kind == JACOKIN_JOINT_3 ? finds_curves(solver, q, work, size) : finds_branch(solver, q, &memory);
    }
    free(work);
    return status != JACOKIN_IK_OK || found ? status : JACOKIN_IK_DAMAGED_FILE;
}

/* Point the names into the text; 0 where there are not as many as there should be. */
static int find_names(jacokin_ik_solver *solver, size_t size) {
    size_t at = 0;
    for (int i = 0; i < 3 + solver->dof; i++) {
        solver->names[i] = solver->text + at;
        while (at < size && solver->text[at] != '\0') at++;
        if (at == size) return 0;
        at++;
    }
    return at == size;
}

int jacokin_ik_read(const void *contents, size_t size, jacokin_ik_solver **solver) {
    if (solver == NULL) return JACOKIN_IK_BAD_ARGUMENT;
    *solver = NULL;
    if (contents == NULL) return JACOKIN_IK_BAD_ARGUMENT;
    const unsigned char *bytes = contents;
    if (size < FILE_HEADER + FILE_CHECK || size > MAX_FILE || memcmp(bytes, "jacokin", 8) != 0)
        return JACOKIN_IK_DAMAGED_FILE;
    if (read_unsigned(bytes + 8, 4) != FILE_VERSION) return JACOKIN_IK_OTHER_VERSION;
    uint64_t dof = read_unsigned(bytes + 12, 4), of = read_unsigned(bytes + 16, 4), text = read_unsigned(bytes + 20, 4);
    if (!(dof == 6 && of == JACOKIN_AFTER) && !(dof == 7 && of <= JACOKIN_JOINT_3)) return JACOKIN_IK_DAMAGED_FILE;
    int joints = (int)dof, kind = (int)of, constants = constants_of(kind);
    size_t doubles = (size_t)((joints + 1) * 12 + constants + 3 * joints + 3);
    if (text > MAX_FILE || size != FILE_HEADER + 8 * doubles + (size_t)text + FILE_CHECK)
        return JACOKIN_IK_DAMAGED_FILE;
    if (read_unsigned(bytes + size - FILE_CHECK, 8) != check_sum(bytes, size - FILE_CHECK))
        return JACOKIN_IK_DAMAGED_FILE;

    jacokin_ik_solver *made = calloc(1, sizeof *made);
    char *names = malloc((size_t)text + 1);
    if (made == NULL || names == NULL) {
        free(made);
        free(names);
        return JACOKIN_IK_NO_MEMORY;
    }
    made->dof = joints;
    made->kind = kind;
    made->text = names;
    double last[3];
    bytes = read_doubles(bytes + FILE_HEADER, (joints + 1) * 12, made->chain);
    bytes = read_doubles(bytes, constants, made->constants);
    bytes = read_doubles(bytes, joints, made->lower);
    bytes = read_doubles(bytes, joints, made->upper);
    bytes = read_doubles(bytes, joints, made->home);
    bytes = read_doubles(bytes, 3, last);
    made->snap = last[0];
    made->position_tolerance = last[1];
    made->orientation_tolerance = last[2];
    memcpy(names, bytes, (size_t)text);
    for (int j = 0; j < 6; j++) {
        made->limits[j] = made->lower[j];
        made->limits[6 + j] = made->upper[j];
        made->limits[12 + j] = made->snap;
    }
    if (kind == JACOKIN_BEFORE) turn_round(made->chain, joints, made->six);
    else memcpy(made->six, made->chain, sizeof made->six);
    int status = makes_sense(made) && find_names(made, (size_t)text) ? finds_itself(made) : JACOKIN_IK_DAMAGED_FILE;
    if (status == JACOKIN_IK_OK) *solver = made;
    else jacokin_ik_free(made);
    return status;
}

#ifndef __wasm__ /* which has no files */
int jacokin_ik_load(const char *path, jacokin_ik_solver **solver) {
    if (solver == NULL) return JACOKIN_IK_BAD_ARGUMENT;
    *solver = NULL;
    if (path == NULL) return JACOKIN_IK_BAD_ARGUMENT;
    FILE *file = fopen(path, "rb");
    if (file == NULL) return JACOKIN_IK_NO_FILE;
    int status = JACOKIN_IK_NO_MEMORY;
    unsigned char *contents = malloc(MAX_FILE + 1);
    if (contents != NULL) {
        size_t size = fread(contents, 1, MAX_FILE + 1, file);
        status = ferror(file) ? JACOKIN_IK_NO_FILE : jacokin_ik_read(contents, size, solver);
    }
    free(contents);
    fclose(file);
    return status;
}
#endif

void jacokin_ik_free(jacokin_ik_solver *solver) {
    if (solver == NULL) return;
    free(solver->text);
    free(solver);
}

/* --- What it knows --------------------------------------------------------------------------------------------- */

int jacokin_ik_dof(const jacokin_ik_solver *solver) { return solver == NULL ? 0 : solver->dof; }

static const char *name_of(const jacokin_ik_solver *solver, int index) {
    return solver == NULL ? "" : solver->names[index];
}

int jacokin_ik_parameter(const jacokin_ik_solver *solver) {
    if (jacokin_ik_dof(solver) != 7) return -1;
    return solver->kind == JACOKIN_JOINT_3 ? 2 : solver->kind == JACOKIN_BEFORE ? 0 : 6;
}

const char *jacokin_ik_robot(const jacokin_ik_solver *solver) { return name_of(solver, 0); }

const char *jacokin_ik_base(const jacokin_ik_solver *solver) { return name_of(solver, 1); }

const char *jacokin_ik_frame(const jacokin_ik_solver *solver) { return name_of(solver, 2); }

const char *jacokin_ik_joint_name(const jacokin_ik_solver *solver, int joint) {
    return joint < 0 || joint >= jacokin_ik_dof(solver) ? "" : name_of(solver, 3 + joint);
}

int jacokin_ik_limits(const jacokin_ik_solver *solver, double *lower, double *upper, double *home) {
    if (solver == NULL) return JACOKIN_IK_BAD_ARGUMENT;
    size_t size = (size_t)solver->dof * sizeof(double);
    if (lower != NULL) memcpy(lower, solver->lower, size);
    if (upper != NULL) memcpy(upper, solver->upper, size);
    if (home != NULL) memcpy(home, solver->home, size);
    return JACOKIN_IK_OK;
}

/* --- Work memory ----------------------------------------------------------------------------------------------- */

/* Numbers of the arrays of each kernel, and below 0 those in a row of one of any length. It holds one row here: a call
 * is for one target, and curves.c points others to what was found. */
#define COUNT(name, numbers) numbers,
#define ROW(name, numbers) -(numbers),
static const int64_t target_arrays[] = {JACOKIN_SOLVE_TARGETS(COUNT, ROW)};
static const int64_t set_arrays[] = {JACOKIN_SOLVE_SET(COUNT, ROW)};
static const int64_t point_arrays[] = {JACOKIN_FIND_POINT(COUNT, ROW)};
static const int64_t nearest_arrays[] = {JACOKIN_FIND_NEAREST(COUNT, ROW)};
#define LENGTH(arrays) (int)(sizeof(arrays) / sizeof *(arrays))
static const struct {
    const int64_t *numbers;
    int arrays, entries;
} tables[] = {
    {target_arrays, LENGTH(target_arrays), TARGETS_TABLE},
    {set_arrays, LENGTH(set_arrays), SET_TABLE},
    {point_arrays, LENGTH(point_arrays), POINT_TABLE},
    {nearest_arrays, LENGTH(nearest_arrays), NEAREST_TABLE},
};

static size_t size_of(int64_t numbers) { return (size_t)(numbers < 0 ? -numbers : numbers); }

/* How many tables the calls for a task need: poses of seven joints are found on curves. */
static int tables_for(const jacokin_ik_solver *solver, enum jacokin_ik_task task) {
    return solver->dof == 7 || task == JACOKIN_IK_INTERVALS ? LENGTH(tables) : 1;
}

size_t jacokin_ik_work_size(const jacokin_ik_solver *solver, enum jacokin_ik_task task) {
    if (solver == NULL) return 0;
    size_t entries = 0;
    for (int n = 0; n < tables_for(solver, task); n++) {
        entries += (size_t)tables[n].entries;
        for (int i = 0; i < tables[n].arrays; i++) entries += size_of(tables[n].numbers[i]);
    }
    return entries * sizeof(entry);
}

int jacokin_lay_out(const jacokin_ik_solver *solver, void *work, size_t work_size, enum jacokin_ik_task task,
                    layout *memory) {
    if (work == NULL || (uintptr_t)work % sizeof(entry) != 0) return JACOKIN_IK_BAD_ARGUMENT;
    if (work_size < jacokin_ik_work_size(solver, task)) return JACOKIN_IK_WORK_TOO_SMALL;
    entry *laid[LENGTH(tables)] = {NULL}, *next = work;
    for (int n = 0; n < tables_for(solver, task); n++) {
        laid[n] = next;
        double *array = (double *)(next + tables[n].entries);
        for (int i = 0; i < tables[n].arrays; i++) {
            int64_t numbers = tables[n].numbers[i];
            next++->numbers = array;
            if (numbers < 0) next++->length = 1;
            array += size_of(numbers);
        }
        next = (entry *)array;
    }
    *memory = (layout){laid[0], laid[1], laid[2], laid[3]};
    return JACOKIN_IK_OK;
}

/* --- Kinematics ------------------------------------------------------------------------------------------------ */

void jacokin_forward(const double *chain, int joints, const double *q, double *pose) {
    double R[9] = {1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0}, p[3] = {0.0, 0.0, 0.0};
    for (int i = 0; i <= joints; i++) {
        const double *C = &chain[12 * i];
        double placed[9];
        for (int row = 0; row < 3; row++) {
            const double *r = &R[3 * row];
            p[row] += r[0] * C[3] + r[1] * C[7] + r[2] * C[11];
            for (int k = 0; k < 3; k++) placed[3 * row + k] = r[0] * C[k] + r[1] * C[4 + k] + r[2] * C[8 + k];
        }
        memcpy(R, placed, sizeof R);
        if (i == joints) break;
        double c = cos(q[i]), s = sin(q[i]);
        for (int row = 0; row < 3; row++) {
            double x = R[3 * row], y = R[3 * row + 1];
            R[3 * row] = x * c + y * s;
            R[3 * row + 1] = y * c - x * s;
        }
    }
    for (int row = 0; row < 3; row++) {
        memcpy(&pose[4 * row], &R[3 * row], 3 * sizeof(double));
        pose[4 * row + 3] = p[row];
    }
    pose[12] = pose[13] = pose[14] = 0.0;
    pose[15] = 1.0;
}

void jacokin_invert(const double *placement, double *inverse) {
    for (int row = 0; row < 3; row++) {
        inverse[4 * row + 3] = 0.0;
        for (int k = 0; k < 3; k++) {
            inverse[4 * row + k] = placement[4 * k + row];
            inverse[4 * row + 3] -= placement[4 * k + row] * placement[4 * k + 3];
        }
    }
}

int jacokin_fk(const jacokin_ik_solver *solver, const double *q, double *pose) {
    if (solver == NULL || q == NULL || pose == NULL) return JACOKIN_IK_BAD_ARGUMENT;
    if (!all_finite(q, solver->dof)) return JACOKIN_IK_NOT_FINITE;
    jacokin_forward(solver->chain, solver->dof, q, pose);
    return JACOKIN_IK_OK;
}

/* Position error [m] and orientation error [rad] of q against a target (16). */
static void measure(const jacokin_ik_solver *solver, const double *T, const double *q, double *errors) {
    double pose[16], turn[3] = {0.0, 0.0, 0.0}, cosine = -1.0;
    jacokin_forward(solver->chain, solver->dof, q, pose);
    double x = T[3] - pose[3], y = T[7] - pose[7], z = T[11] - pose[11];
    errors[0] = sqrt(x * x + y * y + z * z);
    for (int k = 0; k < 3; k++) { /* the columns, reached and wanted: their cross products add up to 2 sin(angle) axis */
        const double a[3] = {pose[k], pose[4 + k], pose[8 + k]}, b[3] = {T[k], T[4 + k], T[8 + k]};
        turn[0] += a[1] * b[2] - a[2] * b[1];
        turn[1] += a[2] * b[0] - a[0] * b[2];
        turn[2] += a[0] * b[1] - a[1] * b[0];
        cosine += a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    }
    errors[1] = atan2(sqrt(turn[0] * turn[0] + turn[1] * turn[1] + turn[2] * turn[2]), cosine);
}

int jacokin_reaches(const jacokin_ik_solver *solver, const double *T, const double *q, double *errors) {
    double measured[2];
    int within = 1;
    for (int j = 0; j < solver->dof; j++) within = within && solver->lower[j] <= q[j] && q[j] <= solver->upper[j];
    if (!within && errors == NULL) return 0;
    if (errors == NULL) errors = measured;
    measure(solver, T, q, errors);
    return within && errors[0] <= solver->position_tolerance && errors[1] <= solver->orientation_tolerance;
}

double jacokin_into_limits(double angle, double lower, double upper) {
    double fewest = ceil((lower - angle) / TURN), most = floor((upper - angle) / TURN); /* turns to be within them */
    if (fewest > most) { /* no copy is: one below the lower limit, the next above the upper limit */
        double low = angle + TURN * most, high = angle + TURN * fewest;
        angle = lower - low <= high - upper ? low : high;
    } else {
        angle += TURN * fmin(fmax(0.0, fewest), most);
    }
    return fmin(fmax(angle, lower), upper);
}

int jacokin_no_answer(const jacokin_ik_solver *solver, double *q, int status) {
    for (int j = 0; j < solver->dof; j++) q[j] = NAN;
    return status;
}

/* --- What is checked at the border ----------------------------------------------------------------------------- */

/* [-] R^T R - I of a rotation that is taken: it admits numbers of single precision. */
static const double RIGID = 1e-6;
/* [-] The same of a product of a dozen rotations: rounding, which is left as it is. */
static const double ORTHONORMAL = 1e-14;

int jacokin_read_target(const double *target, double *T) {
    if (!all_finite(target, 16)) return JACOKIN_IK_NOT_FINITE;
    memcpy(T, target, 16 * sizeof(double));
    double misfit = misfit_of(T, 4);
    if (!(misfit <= RIGID) || determinant_of(T, 4) < 0.0) return JACOKIN_IK_NOT_RIGID;
    if (!(fabs(T[12]) <= RIGID && fabs(T[13]) <= RIGID && fabs(T[14]) <= RIGID && fabs(T[15] - 1.0) <= RIGID))
        return JACOKIN_IK_NOT_RIGID;
    for (int step = 0; step < 2 && misfit > ORTHONORMAL; step++) { /* each squares the misfit: 1e-6, 1e-12, 1e-24 */
        double S[9], R[9];
        for (int i = 0; i < 3; i++)
            for (int j = 0; j < 3; j++)
                S[3 * i + j] = (i == j ? 1.5 : 0.0) - 0.5 * (T[i] * T[j] + T[4 + i] * T[4 + j] + T[8 + i] * T[8 + j]);
        for (int i = 0; i < 3; i++)
            for (int j = 0; j < 3; j++)
                R[3 * i + j] = T[4 * i] * S[j] + T[4 * i + 1] * S[3 + j] + T[4 * i + 2] * S[6 + j];
        for (int i = 0; i < 3; i++) memcpy(&T[4 * i], &R[3 * i], 3 * sizeof(double));
    }
    T[12] = T[13] = T[14] = 0.0;
    T[15] = 1.0;
    return JACOKIN_IK_OK;
}

int jacokin_read_seed(const jacokin_ik_solver *solver, const double *seed, double *inside) {
    if (seed == NULL) seed = solver->home;
    for (int j = 0; j < solver->dof; j++) {
        if (!(fabs(seed[j]) <= FARTHEST)) return JACOKIN_IK_NOT_FINITE;
        double lower = solver->lower[j], upper = solver->upper[j];
        if (lower <= seed[j] && seed[j] <= upper)
            inside[j] = seed[j];
        else /* with more than a turn of travel, the equivalents nearest to a limit are nearest to the seed */
            inside[j] = upper - lower < TURN ? jacokin_into_limits(seed[j], lower, upper)
                                             : fmin(fmax(seed[j], lower), upper);
    }
    return JACOKIN_IK_OK;
}
