/* One free parameter: the curves of all configurations that reach a target, cut into intervals within the limits.
 *
 * A curve runs through seven angles: those of a seven-joint arm, one of which is the parameter; or those of six joints
 * and the angle about a free axis, which is a seventh joint that turns the tool back. The kernels find the pieces of all
 * curves that are within the limits, as runs of nodes along which the parameter rises. What is here hands a target to
 * them, and copies what they found.
 */

#include <string.h>

#include "common.h"

/* Numbers of a node, a point and its tangent; and of a piece, of which these are the columns. */
enum { NODE = 14, PIECE = 6 };
enum { FIRST = 0, END = 1, CODES = 2, BRANCH = 4 };
/* Index of a free axis among the seven angles. */
enum { FREE_AXIS = 6 };
/* [rad] Values of the parameter that differ by rounding, also at the ends of an interval. */
static const double SAME_PARAMETER = 1e-9;
/* [rad] A range this near to a full turn is one. */
static const double FULL_TURN = 1e-12;
/* [rad] of a range: a parameter keeps its digits. */
static const double FARTHEST_ANGLE = 1e3;

/* A target whose configurations have one free parameter. */
typedef struct {
    const jacokin_ik_solver *solver;
    layout memory;
    double T[16];
    double axis[3];  /* unit vector in the tool frame; six joints */
    double range[2]; /* [rad] of the parameter */
    int closed;      /* whether it goes round a circle */
} problem;

/* --- The target ------------------------------------------------------------------------------------------------ */

/* Index of the parameter among the seven angles. */
static int parameter_of(const jacokin_ik_solver *solver) {
    return solver->dof == 6 ? FREE_AXIS : jacokin_ik_parameter(solver);
}

/* Check a target and lay out memory for it. */
static int read_problem(const jacokin_ik_solver *solver, const double *target, const jacokin_ik_axis *about, void *work,
                        size_t work_size, problem *of) {
    if ((solver->dof == 6) != (about != NULL)) return JACOKIN_IK_WRONG_ARM;
    *of = (problem){.solver = solver, .range = {-PI, PI}, .closed = 1};
    int status = jacokin_lay_out(solver, work, work_size, JACOKIN_IK_INTERVALS, &of->memory);
    if (status == JACOKIN_IK_OK) status = jacokin_read_target(target, of->T);
    if (status != JACOKIN_IK_OK || about == NULL) return status;
    double x = about->direction[0], y = about->direction[1], z = about->direction[2];
    double low = about->range[0], high = about->range[1];
    if (!isfinite(x) || !isfinite(y) || !isfinite(z) || !isfinite(low) || !isfinite(high)) return JACOKIN_IK_NOT_FINITE;
    double largest = fmax(fabs(x), fmax(fabs(y), fabs(z))); /* the squares of any length but 0 are numbers beside it */
    if (!(largest > 0.0)) return JACOKIN_IK_BAD_ARGUMENT;
    x /= largest, y /= largest, z /= largest;
    double length = sqrt(x * x + y * y + z * z);
    if (!(low < high) || high - low > TURN + FULL_TURN || fmax(fabs(low), fabs(high)) > FARTHEST_ANGLE)
        return JACOKIN_IK_BAD_ARGUMENT;
    of->axis[0] = x / length;
    of->axis[1] = y / length;
    of->axis[2] = z / length;
    of->range[0] = low;
    of->range[1] = high;
    of->closed = high - low >= TURN - FULL_TURN;
    return JACOKIN_IK_OK;
}

/* The target (16) turned about its axis by p. */
static void turn_target(const double *T, const double *axis, double p, double *turned) {
    double c = cos(p), s = sin(p), x = axis[0], y = axis[1], z = axis[2];
    memcpy(turned, T, 16 * sizeof(double));
    for (int i = 0; i < 3; i++) {
        double a = T[4 * i], b = T[4 * i + 1], d = T[4 * i + 2], along = (1.0 - c) * (a * x + b * y + d * z);
        turned[4 * i] = c * a + along * x + s * (b * z - d * y);
        turned[4 * i + 1] = c * b + along * y + s * (d * x - a * z);
        turned[4 * i + 2] = c * d + along * z + s * (a * y - b * x);
    }
}

/* The angle about the axis by which the tool at q is turned from the target, or comes nearest to that. */
static double angle_about(const problem *of, const double *q) {
    double pose[16], R[9], cosine = 0.0;
    const double *T = of->T, *a = of->axis;
    jacokin_forward(of->solver->chain, 6, q, pose);
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++) {
            R[3 * i + k] = T[i] * pose[k] + T[4 + i] * pose[4 + k] + T[8 + i] * pose[8 + k];
            cosine += ((i == k ? 1.0 : 0.0) - a[i] * a[k]) * R[3 * i + k];
        }
    return atan2(a[0] * (R[7] - R[5]) + a[1] * (R[2] - R[6]) + a[2] * (R[3] - R[1]), cosine);
}

/* Whether q reaches a target within the limits, on six joints one turned about its axis by p. */
static int reaches(const jacokin_ik_solver *solver, const double *T, const double *axis, double p, const double *q) {
    double turned[16];
    if (solver->dof == 7) return jacokin_reaches(solver, T, q, NULL);
    turn_target(T, axis, p, turned);
    return jacokin_reaches(solver, turned, q, NULL);
}

/* The joints of a point (7) in the 2 pi equivalents within the limits nearest to a seed; whether they then reach the
 * target. */
static int settle(const jacokin_ik_solver *solver, const double *T, const double *axis, const double *x,
                  const double *seed, double *q) {
    for (int j = 0; j < solver->dof; j++) {
        double near = x[j] + TURN * rint((seed[j] - x[j]) / TURN);
        q[j] = jacokin_into_limits(near, solver->lower[j], solver->upper[j]);
    }
    return reaches(solver, T, axis, x[FREE_AXIS], q);
}

/* --- The curves ------------------------------------------------------------------------------------------------ */

/* Let a seventh joint follow six: one about minus the axis, which turns the tool back. */
static void add_axis(const double *axis, double *chain) {
    double *C = &chain[6 * 12], *D = &chain[7 * 12], x = -axis[0], y = -axis[1], z = -axis[2];
    double side = z < 0.0 ? -1.0 : 1.0, a = -1.0 / (side + z), b = x * y * a;
    const double R[9] = {1.0 + side * x * x * a, b, x, side * b, side + y * y * a, y, -side * x, -y, z};
    for (int i = 0; i < 3; i++) {
        double row[3] = {C[4 * i], C[4 * i + 1], C[4 * i + 2]};
        for (int k = 0; k < 3; k++) {
            C[4 * i + k] = row[0] * R[k] + row[1] * R[3 + k] + row[2] * R[6 + k];
            D[4 * k + i] = R[3 * i + k];
        }
        D[4 * i + 3] = 0.0;
    }
}

/* The target (16) of the six joints of an arm of seven where the seventh is at 0. */
static void target_of_six(const problem *of, double *T) {
    double left[12], right[12];
    jacokin_invert(of->T, left);
    jacokin_invert(&of->solver->six[7 * 12], right);
    const double *a = of->solver->kind == JACOKIN_BEFORE ? left : of->T;
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 4; k++)
            T[4 * i + k] = a[4 * i] * right[k] + a[4 * i + 1] * right[4 + k] + a[4 * i + 2] * right[8 + k] +
                           (k == 3 ? a[4 * i + 3] : 0.0);
    memcpy(&T[12], &of->T[12], 4 * sizeof(double));
}

/* Find all pieces within the limits, also those of the curve beside a start (7) that is not null. Returns how many;
 * *complete tells whether nothing is missing. */
static int find_pieces(const problem *of, const double *start, int *complete) {
    const jacokin_ik_solver *solver = of->solver;
    entry *set = of->memory.set;
    memcpy(set[SET_walk_chain].numbers, solver->chain, (size_t)(solver->dof + 1) * 12 * sizeof(double));
    memcpy(set[SET_walk_T].numbers, of->T, sizeof of->T);
    if (solver->dof == 6) add_axis(of->axis, set[SET_walk_chain].numbers);
    set[SET_walk_parameter].integers[0] = parameter_of(solver);
    set[SET_options].integers[0] = solver->kind;
    set[SET_options].integers[1] = solver->dof;
    set[SET_options].integers[2] = 1; /* whether curves may be missing is asked */
    set[SET_near_slack].numbers[0] = 0.0; /* no structure that the arm nearly has */
    for (int j = 0; j < 7; j++) { /* solutions as near to a seed as the nearest one are enough */
        int joint = j < solver->dof;
        set[SET_near_seed].numbers[j] = start != NULL ? start[j] : NAN;
        set[SET_near_bounds].numbers[j] = joint ? solver->lower[j] : of->closed ? -INFINITY : of->range[0];
        set[SET_near_bounds].numbers[7 + j] = joint ? solver->upper[j] : of->closed ? INFINITY : of->range[1];
    }
    set[SET_starts_length].length = start != NULL;
    if (start != NULL) memcpy(set[SET_starts].numbers, start, 7 * sizeof(double));
    if (solver->kind == JACOKIN_JOINT_3) {
        memcpy(set[SET_seven_arm].numbers, solver->constants, CONSTANTS_SEVEN * sizeof(double));
    } else {
        const double back[3] = {0.0, 0.0, -1.0};
        memcpy(set[SET_six_chain].numbers, solver->six, 7 * 12 * sizeof(double));
        memcpy(set[SET_six_arm].numbers, solver->constants, CONSTANTS_SIX * sizeof(double));
        memcpy(set[SET_six_axis].numbers, solver->dof == 6 ? of->axis : back, sizeof back);
        if (solver->dof == 6) memcpy(set[SET_six_T].numbers, of->T, sizeof of->T);
        else target_of_six(of, set[SET_six_T].numbers);
        for (int j = 0; j < 6; j++) {
            set[SET_six_seed].numbers[j] = 0.0;
            set[SET_six_limits].numbers[j] = -INFINITY;
            set[SET_six_limits].numbers[6 + j] = INFINITY;
            set[SET_six_limits].numbers[12 + j] = 0.0;
        }
    }
    double *limits = set[SET_pieces_limits].numbers;
    for (int j = 0; j < 7; j++) { /* with a turn or more, every angle has an equivalent within the limits */
        int bounded = j < solver->dof ? solver->upper[j] - solver->lower[j] < TURN : !of->closed;
        limits[j] = !bounded ? -INFINITY : j < solver->dof ? solver->lower[j] : of->range[0];
        limits[7 + j] = !bounded ? INFINITY : j < solver->dof ? solver->upper[j] : of->range[1];
    }

    int64_t wrong = jacokin_solve_set(set), *size = set[SET_pieces_size].integers;
    if (wrong < 0) size[0] = size[1] = size[2] = 0; /* the kernel could not do it */
    *complete = wrong == 0;
    for (int64_t n = 0; n < size[1]; n++) { /* a point at which joints pass their limits at once may be outside them */
        int64_t *piece = &set[SET_pieces_ends].integers[PIECE * n];
        const double *x = &set[SET_pieces_nodes].numbers[NODE * piece[FIRST]];
        double q[JACOKIN_IK_MAX_DOF];
        if (piece[END] - piece[FIRST] > 1 || settle(solver, of->T, of->axis, x, x, q)) continue;
        piece[END] = piece[FIRST];
        *complete = 0;
    }
    return (int)size[1];
}

/* The status where nothing of the curves is within the limits. */
static int why_not(const problem *of, int complete) {
    if (!complete) return JACOKIN_IK_NO_CONVERGENCE;
    int64_t branches = of->memory.set[SET_pieces_size].integers[2];
    return branches == 0 ? JACOKIN_IK_UNREACHABLE : JACOKIN_IK_OUTSIDE_LIMITS;
}

/* --- Intervals ------------------------------------------------------------------------------------------------- */

static void fill_interval(const problem *of, int n, jacokin_ik_interval *interval) {
    const int64_t *piece = &of->memory.set[SET_pieces_ends].integers[PIECE * n];
    const double *p = &of->memory.set[SET_pieces_nodes].numbers[parameter_of(of->solver)];
    double start = p[NODE * piece[FIRST]], stop = p[NODE * (piece[END] - 1)];
    if (stop - start <= SAME_PARAMETER) stop = start;
    double turns = of->closed ? floor((start + PI) / TURN)
                              : rint((0.5 * (start + stop) - 0.5 * (of->range[0] + of->range[1])) / TURN);
    interval->shift = TURN * turns;
    interval->start = start - interval->shift;
    interval->stop = stop - interval->shift;
    interval->branch = (int)piece[BRANCH];
    interval->piece = n;
    for (int side = 0; side < 2; side++) {
        int code = (int)piece[CODES + side], joint = code >= 0 ? code / 2 : -1;
        int is_joint = joint >= 0 && joint < of->solver->dof;
        interval->joints[side] = is_joint ? joint : -1;
        interval->ends[side] = is_joint                 ? JACOKIN_IK_END_LIMIT
                               : joint >= 0             ? JACOKIN_IK_END_RANGE
                               : code == JACOKIN_FOLD   ? JACOKIN_IK_END_FOLD
                               : code == JACOKIN_CIRCLE ? JACOKIN_IK_END_CIRCLE
                                                        : JACOKIN_IK_END_LOST;
    }
}

int jacokin_ik_intervals(const jacokin_ik_solver *solver, const double *target, const jacokin_ik_axis *about, void *work,
                         size_t work_size, jacokin_ik_interval *intervals, int capacity, int *count, int *complete) {
    if (solver == NULL || target == NULL || count == NULL || capacity < 0 || (intervals == NULL && capacity > 0))
        return JACOKIN_IK_BAD_ARGUMENT;
    *count = 0;
    if (complete != NULL) *complete = 0;
    problem of;
    int status = read_problem(solver, target, about, work, work_size, &of);
    if (status != JACOKIN_IK_OK) return status;
    int whole, pieces = find_pieces(&of, NULL, &whole);
    for (int n = 0; n < pieces; n++) {
        const int64_t *piece = &of.memory.set[SET_pieces_ends].integers[PIECE * n];
        if (piece[END] == piece[FIRST]) continue;
        jacokin_ik_interval interval;
        fill_interval(&of, n, &interval);
        int at = *count < capacity ? *count : capacity; /* by branch and start; those that come last may find no room */
        for (++*count; at > 0; at--) {
            const jacokin_ik_interval *other = &intervals[at - 1];
            if (other->branch < interval.branch || (other->branch == interval.branch && other->start <= interval.start))
                break;
            if (at < capacity) intervals[at] = *other;
        }
        if (at < capacity) intervals[at] = interval;
    }
    if (complete != NULL) *complete = whole;
    if (*count > capacity) return JACOKIN_IK_NO_ROOM;
    return *count > 0 ? JACOKIN_IK_OK : why_not(&of, whole);
}

/* --- Points ---------------------------------------------------------------------------------------------------- */

/* The point (7) of nodes from first up to end where their parameter has a value; where curves meet, the node beside. */
static const double *point_of(const layout *memory, int parameter, int64_t first, int64_t end, double p) {
    entry *set = memory->set, *point = memory->point;
    const double *nodes = set[SET_pieces_nodes].numbers;
    int64_t low = first, high = end - 1; /* nodes on both sides of p */
    if (p <= nodes[NODE * low + parameter]) return &nodes[NODE * low];
    if (p >= nodes[NODE * high + parameter]) return &nodes[NODE * high];
    while (high - low > 1) {
        int64_t middle = low + (high - low) / 2;
        if (nodes[NODE * middle + parameter] <= p) low = middle;
        else high = middle;
    }
    point[POINT_walk_chain] = set[SET_walk_chain];
    point[POINT_walk_T] = set[SET_walk_T];
    point[POINT_walk_parameter] = set[SET_walk_parameter];
    point[POINT_nodes].numbers = set[SET_pieces_nodes].numbers + NODE * low;
    point[POINT_at].numbers[0] = p;
    if (jacokin_find_point(point) == 1) return point[POINT_x].numbers;
    return &nodes[NODE * (p - nodes[NODE * low + parameter] < nodes[NODE * high + parameter] - p ? low : high)];
}

int jacokin_ik_at(const jacokin_ik_solver *solver, void *work, size_t work_size, const jacokin_ik_interval *interval,
                  double p, const double *seed, double *q) {
    if (solver == NULL || q == NULL) return JACOKIN_IK_BAD_ARGUMENT;
    layout memory;
    double start[JACOKIN_IK_MAX_DOF], axis[3] = {0.0, 0.0, 0.0};
    int status = interval == NULL ? JACOKIN_IK_BAD_ARGUMENT
                                  : jacokin_lay_out(solver, work, work_size, JACOKIN_IK_INTERVALS, &memory);
    if (status == JACOKIN_IK_OK) status = jacokin_read_seed(solver, seed, start);
    if (status == JACOKIN_IK_OK && !isfinite(p)) status = JACOKIN_IK_NOT_FINITE;
    if (status != JACOKIN_IK_OK) return jacokin_no_answer(solver, q, status);
    if (p < interval->start || p > interval->stop) {
        p += TURN * rint((0.5 * (interval->start + interval->stop) - p) / TURN);
        if (!(interval->start - SAME_PARAMETER <= p && p <= interval->stop + SAME_PARAMETER))
            return jacokin_no_answer(solver, q, JACOKIN_IK_BAD_ARGUMENT);
    }
    int64_t pieces = memory.set[SET_pieces_size].integers[1], n = interval->piece;
    if (n < 0 || n >= pieces || pieces > JACOKIN_PIECES) /* memory in which no intervals were found */
        return jacokin_no_answer(solver, q, JACOKIN_IK_BAD_ARGUMENT);
    const int64_t *piece = &memory.set[SET_pieces_ends].integers[PIECE * n];
    if (!(0 <= piece[FIRST] && piece[FIRST] < piece[END] && piece[END] <= JACOKIN_ROWS))
        return jacokin_no_answer(solver, q, JACOKIN_IK_BAD_ARGUMENT);
    const double *x = point_of(&memory, parameter_of(solver), piece[FIRST], piece[END], p + interval->shift);
    if (solver->dof == 6) memcpy(axis, memory.set[SET_six_axis].numbers, sizeof axis);
    if (!settle(solver, memory.set[SET_walk_T].numbers, axis, x, start, q))
        return jacokin_no_answer(solver, q, JACOKIN_IK_NO_CONVERGENCE);
    return JACOKIN_IK_OK;
}

/* The nearest configuration to a seed that was checked; *parameter is that of its curve. */
static int nearest_on_curves(const problem *of, const double *seed, double *q, double *parameter) {
    const jacokin_ik_solver *solver = of->solver;
    entry *set = of->memory.set, *nearest = of->memory.nearest;
    double start[7] = {0.0};
    memcpy(start, seed, (size_t)solver->dof * sizeof(double));
    if (solver->dof == 6) start[FREE_AXIS] = angle_about(of, seed);
    int complete, pieces = find_pieces(of, start, &complete);
    nearest[NEAREST_walk_chain] = set[SET_walk_chain];
    nearest[NEAREST_walk_T] = set[SET_walk_T];
    nearest[NEAREST_nodes] = set[SET_pieces_nodes];
    nearest[NEAREST_nodes_length].length = set[SET_pieces_size].integers[0];
    nearest[NEAREST_ends] = set[SET_pieces_ends];
    nearest[NEAREST_ends_length].length = pieces;
    for (int j = 0; j < 7; j++) {
        int counts = j < solver->dof;
        nearest[NEAREST_seed].numbers[j] = counts ? seed[j] : 0.0;
        nearest[NEAREST_weights].numbers[j] = counts ? 1.0 : 0.0;
        nearest[NEAREST_limits].numbers[j] = counts ? solver->lower[j] : -INFINITY;
        nearest[NEAREST_limits].numbers[7 + j] = counts ? solver->upper[j] : INFINITY;
    }
    if (jacokin_find_nearest(nearest) != 1) return why_not(of, complete);
    const double *x = nearest[NEAREST_x].numbers; /* in the equivalents that count, but for rounding */
    for (int j = 0; j < solver->dof; j++) q[j] = fmin(fmax(x[j], solver->lower[j]), solver->upper[j]);
    if (!reaches(solver, of->T, of->axis, x[FREE_AXIS], q)) return JACOKIN_IK_NO_CONVERGENCE;
    *parameter = solver->dof == 7 ? q[parameter_of(solver)] : x[FREE_AXIS];
    return JACOKIN_IK_OK;
}

int jacokin_nearest_on_curves(const jacokin_ik_solver *solver, const double *T, const double *seed,
                              const layout *memory, double *q) {
    problem of = {.solver = solver, .memory = *memory, .range = {-PI, PI}, .closed = 1};
    double parameter;
    memcpy(of.T, T, sizeof of.T);
    int status = nearest_on_curves(&of, seed, q, &parameter);
    return status == JACOKIN_IK_OK ? status : jacokin_no_answer(solver, q, status);
}

int jacokin_ik_nearest_about(const jacokin_ik_solver *solver, const double *target, const jacokin_ik_axis *about,
                             const double *seed, void *work, size_t work_size, double *q, double *parameter) {
    if (solver == NULL || q == NULL) return JACOKIN_IK_BAD_ARGUMENT;
    problem of;
    double start[JACOKIN_IK_MAX_DOF], p = NAN;
    int status = target == NULL ? JACOKIN_IK_BAD_ARGUMENT : read_problem(solver, target, about, work, work_size, &of);
    if (status == JACOKIN_IK_OK) status = jacokin_read_seed(solver, seed, start);
    if (status == JACOKIN_IK_OK) status = nearest_on_curves(&of, start, q, &p);
    if (status != JACOKIN_IK_OK) jacokin_no_answer(solver, q, status);
    if (status == JACOKIN_IK_OK && about != NULL) /* the equivalent that is in the range */
        p += TURN * rint((0.5 * (of.range[0] + of.range[1]) - p) / TURN);
    if (parameter != NULL) *parameter = status == JACOKIN_IK_OK ? p : NAN;
    return status;
}
