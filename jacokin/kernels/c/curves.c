/* One free parameter: the curves of all configurations that reach a target, cut into intervals within the limits.
 *
 * A curve runs through seven angles: those of a seven-joint arm, the parameter being joint 3; or those of six joints and
 * the angle about a free axis, which is a seventh joint that turns the tool back. The kernel finds arcs along which the
 * parameter rises, as runs of nodes, and on them pieces within the limits, a row each. Where the free axis is the axis
 * of joint 6, curves are straight lines: the branches of one pose, on which joint 6 takes up every turn.
 */

#include <string.h>

#include "common.h"

/* Index of the parameter among the seven angles. */
enum { FREE_AXIS = 6, JOINT_3 = 2 };
/* A row of a piece: arc, first and last chord, codes and shares of both ends, the points there. */
enum { ARC = 0, FIRST = 1, LAST = 2, CODES = 3, START = 7, STOP = 14 };
/* A row of a line has no arc, and its sign where others have their first chord. */
static const double LINE = -1.0;
/* Sine and [m]: a free axis this near to the axis of joint 6 is that axis. */
static const double SAME_AXIS = 1e-10;
/* [rad] Values of the parameter that differ by rounding, also at the ends of an interval. */
static const double SAME_PARAMETER = 1e-9;
/* [rad] A range this near to a full turn is one. */
static const double FULL_TURN = 1e-12;
/* [rad] of a range: a parameter keeps its digits. */
static const double FARTHEST_ANGLE = 1e3;
/* [rad] Curves that are all shorter are at the edge of reach. */
static const double SMALL = 1e-5;
/* A target whose configurations have one free parameter. */
typedef struct {
    const jacokin_ik_solver *solver;
    double T[16];
    double axis[3];  /* unit vector in the tool frame; six joints */
    double range[2]; /* [rad] of the angle about it */
    int parameter;   /* FREE_AXIS or JOINT_3 */
    int closed;      /* whether the parameter goes round a circle */
    double sign;     /* 1 or -1 where the axis is that of joint 6, one way or the other; else 0 */
    entry *table;
} problem;

/* --- The target ------------------------------------------------------------------------------------------------ */

/* Check a target and lay out memory for it. */
static int read_problem(const jacokin_ik_solver *solver, const double *target, const jacokin_ik_axis *about, void *work,
                        size_t work_size, layout *memory, problem *of) {
    if ((solver->dof == 6) != (about != NULL)) return JACOKIN_IK_WRONG_ARM;
    int status = jacokin_lay_out(solver, work, work_size, JACOKIN_IK_INTERVALS, memory);
    if (status == JACOKIN_IK_OK) status = jacokin_read_target(target, of->T);
    if (status != JACOKIN_IK_OK) return status;
    of->solver = solver;
    of->table = memory->curves;
    of->parameter = about == NULL ? JOINT_3 : FREE_AXIS;
    of->closed = 1;
    of->sign = 0.0;
    of->range[0] = -PI;
    of->range[1] = PI;
    of->axis[0] = of->axis[1] = of->axis[2] = 0.0;
    if (about == NULL) return JACOKIN_IK_OK;
    double x = about->direction[0], y = about->direction[1], z = about->direction[2];
    double low = about->range[0], high = about->range[1];
    if (!isfinite(x) || !isfinite(y) || !isfinite(z) || !isfinite(low) || !isfinite(high)) return JACOKIN_IK_NOT_FINITE;
    double length = sqrt(x * x + y * y + z * z);
    if (!(length > 0.0) || !isfinite(length)) return JACOKIN_IK_BAD_ARGUMENT;
    if (!(low < high) || high - low > TURN + FULL_TURN || fmax(fabs(low), fabs(high)) > FARTHEST_ANGLE)
        return JACOKIN_IK_BAD_ARGUMENT;
    of->axis[0] = x /= length;
    of->axis[1] = y /= length;
    of->axis[2] = z /= length;
    of->range[0] = low;
    of->range[1] = high;
    of->closed = high - low >= TURN - FULL_TURN;
    const double *C = &solver->chain[6 * 12], *row = &C[8]; /* row: axis 6 in the tool frame */
    double beside = fmax(hypot(C[3], C[7]), hypot(hypot(y * row[2] - z * row[1], z * row[0] - x * row[2]),
                                                  x * row[1] - y * row[0]));
    if (beside <= SAME_AXIS) of->sign = x * row[0] + y * row[1] + z * row[2] > 0.0 ? 1.0 : -1.0;
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

/* The joints of a point (7) in the copies within the limits nearest to a seed; whether they then reach the target. */
static int settle(const jacokin_ik_solver *solver, const double *T, const double *axis, int parameter, const double *x,
                  const double *seed, double *q) {
    double turned[16];
    for (int j = 0; j < solver->dof; j++) {
        double near = x[j] + TURN * rint((seed[j] - x[j]) / TURN);
        q[j] = jacokin_into_limits(near, solver->lower[j], solver->upper[j]);
    }
    if (parameter != FREE_AXIS) return jacokin_reaches(solver, T, q, NULL);
    turn_target(T, axis, x[FREE_AXIS], turned);
    return jacokin_reaches(solver, turned, q, NULL);
}

/* --- The curves ------------------------------------------------------------------------------------------------ */

/* Values of the parameter to solve at, rising; returns how many. */
static int choose_slices(const problem *of, double *values) {
    static const double quarters[] = {-0.5 * PI, 0.0, 0.5 * PI, PI}; /* what is singular is so in a structured pose */
    int n = of->parameter == FREE_AXIS ? JACOKIN_SLICES_SIX : JACOKIN_SLICES_SEVEN;
    if (of->closed) {
        for (int i = 0; i < n; i++) values[i] = JACOKIN_FIRST_SLICE + TURN / n * i;
    } else {
        double low = of->range[0], high = of->range[1];
        n = 2 + (int)ceil(n * (high - low) / TURN);
        for (int i = 0; i < n; i++) values[i] = low + (high - low) / (n - 1) * i;
        values[n - 1] = high;
    }
    for (int k = 0; k < 4 && of->parameter == FREE_AXIS; k++) {
        double p = quarters[k] - TURN * floor((quarters[k] - values[0]) / TURN);
        int at = 0;
        while (at < n && values[at] < p) at++;
        if (at == n || values[at] - p <= JACOKIN_SAME_SLICE || (at > 0 && p - values[at - 1] <= JACOKIN_SAME_SLICE))
            continue;
        memmove(&values[at + 1], &values[at], (size_t)(n - at) * sizeof(double));
        values[at] = p;
        n++;
    }
    return n;
}

/* A rotation in columns x, y, z whose z is minus a unit vector. */
static void align(const double *axis, double *x, double *y, double *z) {
    int least = 0;
    for (int i = 0; i < 3; i++) {
        z[i] = -axis[i];
        if (fabs(z[i]) < fabs(z[least])) least = i;
    }
    double e[3] = {0.0, 0.0, 0.0};
    e[least] = 1.0;
    x[0] = z[1] * e[2] - z[2] * e[1];
    x[1] = z[2] * e[0] - z[0] * e[2];
    x[2] = z[0] * e[1] - z[1] * e[0];
    double length = sqrt(x[0] * x[0] + x[1] * x[1] + x[2] * x[2]);
    for (int i = 0; i < 3; i++) x[i] /= length;
    y[0] = z[1] * x[2] - z[2] * x[1];
    y[1] = z[2] * x[0] - z[0] * x[2];
    y[2] = z[0] * x[1] - z[1] * x[0];
}

/* Whether some limits of a joint end intervals: others have a copy of every angle between them. */
static int is_bounded(const jacokin_ik_solver *solver, int j) {
    return j < solver->dof && solver->upper[j] - solver->lower[j] < TURN;
}

/* Fill everything in that the kernel reads for a task. */
static void prepare(const problem *of, int task) {
    const jacokin_ik_solver *solver = of->solver;
    entry *table = of->table;
    double *chain = table[CURVES_chain].numbers;
    memcpy(chain, solver->chain, (size_t)(solver->dof + 1) * 12 * sizeof(double));
    if (of->parameter == FREE_AXIS) {
        /* Turning the tool about its axis by p is turning it back by a joint of angle p about minus the axis. */
        double x[3], y[3], z[3], *C = &chain[6 * 12], *D = &chain[7 * 12];
        align(of->axis, x, y, z);
        for (int i = 0; i < 3; i++) {
            double a = C[4 * i], b = C[4 * i + 1], c = C[4 * i + 2];
            C[4 * i] = a * x[0] + b * x[1] + c * x[2];
            C[4 * i + 1] = a * y[0] + b * y[1] + c * y[2];
            C[4 * i + 2] = a * z[0] + b * z[1] + c * z[2];
            D[i] = x[i];
            D[4 + i] = y[i];
            D[8 + i] = z[i];
            D[4 * i + 3] = 0.0;
        }
        memcpy(table[CURVES_six_chain].numbers, solver->chain, 7 * 12 * sizeof(double));
        memcpy(table[CURVES_six_arm].numbers, solver->constants, CONSTANTS_SIX * sizeof(double));
        memcpy(table[CURVES_six_axis].numbers, of->axis, sizeof of->axis);
        for (int j = 0; j < 6; j++) {
            table[CURVES_six_seed].numbers[j] = 0.0;
            table[CURVES_six_limits].numbers[j] = -INFINITY;
            table[CURVES_six_limits].numbers[6 + j] = INFINITY;
            table[CURVES_six_limits].numbers[12 + j] = 0.0;
        }
    } else {
        memcpy(table[CURVES_seven_arm].numbers, solver->constants, CONSTANTS_SEVEN * sizeof(double));
    }
    memcpy(table[CURVES_T].numbers, of->T, sizeof of->T);
    for (int j = 0; j < 7; j++) {
        table[CURVES_cuts_limits].numbers[j] = is_bounded(solver, j) ? solver->lower[j] : -INFINITY;
        table[CURVES_cuts_limits].numbers[7 + j] = is_bounded(solver, j) ? solver->upper[j] : INFINITY;
    }
    memset(table[CURVES_slices_crossed].integers, 0, JACOKIN_SLICES * sizeof(int64_t));
    memset(table[CURVES_counts].integers, 0, 4 * sizeof(int64_t));
    int64_t *options = table[CURVES_options].integers;
    options[0] = task;
    options[1] = of->parameter;
    options[2] = choose_slices(of, table[CURVES_slices_p].numbers);
    options[3] = of->closed;
}

/* Find all pieces; returns how many, and whether nothing is missing. */
static int find_pieces(const problem *of, int *complete) {
    prepare(of, JACOKIN_FIND_INTERVALS);
    entry *table = of->table;
    int64_t count = jacokin_run_curves(table);
    const int64_t *counts = table[CURVES_counts].integers, *size = table[CURVES_arcs_size].integers;
    const int64_t *arcs = table[CURVES_arcs_arcs].integers;
    const double *nodes = table[CURVES_arcs_nodes].numbers;
    if (count < 0) { /* the kernel could not do it */
        *complete = 0;
        return 0;
    }
    double longest = 0.0;
    for (int64_t arc = 0; arc < size[1]; arc++) {
        double first = nodes[14 * arcs[4 * arc] + of->parameter], last = nodes[14 * (arcs[4 * arc + 1] - 1) + of->parameter];
        longest = fmax(longest, fabs(last - first));
    }
    int full = size[0] == JACOKIN_NODES || size[1] == JACOKIN_ARCS || count == JACOKIN_INTERVALS;
    /* Members of a straight wrist, among which the parameter stands still, are not found here. */
    int straight = table[CURVES_straight_filled].integers[0] > 0;
    int at_edge = size[1] > 0 && longest < SMALL;
    /* Small closed curves are found for certain on arms built like a Jaco only. */
    int sees_loops = of->solver->dof != 6 || of->solver->constants[OTHER_STRUCTURE] == 0.0;
    *complete = sees_loops && !full && counts[1] == 0 && counts[2] == 0 && counts[3] == 0 && !at_edge && !straight;
    return (int)count;
}

/* --- Lines: the free axis is that of joint 6 ------------------------------------------------------------------- */

/* Fill rows with the ranges of the angle in which joint 6 has a copy within its limits, on every branch whose other
 * joints are within theirs. Returns how many; *branches is how many branches there are. */
static int find_lines(const problem *of, entry *targets, double *rows, int *branches, int *complete) {
    const jacokin_ik_solver *solver = of->solver;
    int dropped, found = 0;
    *branches = jacokin_find_branches(solver, of->T, solver->home, targets, &dropped);
    *complete = !dropped;
    const double *table = targets[TARGETS_pose_branches_rows].numbers;
    double low = of->closed ? -PI : of->range[0], high = of->closed ? PI : of->range[1];
    int nothing = of->closed ? JACOKIN_IK_END_CIRCLE : JACOKIN_IK_END_RANGE;
    for (int i = 0; i < *branches; i++) {
        const double *q = &table[i * JACOKIN_COLUMNS];
        int within = 1;
        for (int j = 0; j < 5; j++) within = within && q[6 + j] >= 0.0;
        if (q[JACOKIN_FAMILY] == 1.0) *complete = 0; /* it stands for a whole self-motion */
        if (!within) continue;
        double a = of->sign * (solver->lower[5] - q[5]), b = of->sign * (solver->upper[5] - q[5]);
        int whole = !is_bounded(solver, 5);
        int turns = whole ? 0 : (int)floor((low - fmax(a, b)) / TURN);
        int last = whole ? 0 : (int)ceil((high - fmin(a, b)) / TURN);
        for (; turns <= last && found < JACOKIN_INTERVALS; turns++) {
            double start = whole ? low : fmin(a, b) + TURN * turns, stop = whole ? high : fmax(a, b) + TURN * turns;
            int codes[2] = {-1 - nothing, -1 - nothing};
            if (!whole && of->closed && !(low <= start && start < high)) continue; /* an interval may pass pi */
            if (!whole && (of->closed || start >= low)) codes[0] = of->sign > 0.0 ? 10 : 11;
            if (!whole && (of->closed || stop <= high)) codes[1] = of->sign > 0.0 ? 11 : 10;
            if (!of->closed) {
                start = fmax(start, low);
                stop = fmin(stop, high);
            }
            if (start > stop) continue;
            double *row = &rows[JACOKIN_INTERVAL_COLUMNS * found++];
            row[ARC] = LINE - i; /* its branch too */
            row[FIRST] = of->sign;
            row[CODES] = codes[0];
            row[CODES + 1] = codes[1];
            for (int side = 0; side < 2; side++) {
                double *x = &row[side ? STOP : START], p = side ? stop : start;
                memcpy(x, q, 6 * sizeof(double));
                x[5] = q[5] + of->sign * p;
                x[FREE_AXIS] = p;
            }
        }
    }
    return found;
}

/* --- Intervals ------------------------------------------------------------------------------------------------- */

/* The kernel's ends as the header names them, by their code there: -1 fold, -2 range, -3 seam, -4 lost. Lines have the
 * header's own. */
static void fill_end(jacokin_ik_interval *interval, int side, double code, int is_line) {
    static const int kinds[] = {JACOKIN_IK_END_FOLD, JACOKIN_IK_END_RANGE, JACOKIN_IK_END_CIRCLE, JACOKIN_IK_END_LOST};
    int n = -1 - (int)code;
    interval->ends[side] = code >= 0.0 ? JACOKIN_IK_END_LIMIT : is_line ? n : kinds[n];
    interval->joints[side] = code >= 0.0 ? (int)code / 2 : -1;
}

/* Where intervals go: sorted, and counted where there is no room. */
typedef struct {
    const problem *of;
    const double *rows;
    jacokin_ik_interval *intervals;
    int capacity, count;
} output;

static void insert(output *to, const jacokin_ik_interval *interval) {
    int at = to->count < to->capacity ? to->count : to->capacity;
    to->count++;
    while (at > 0 && (interval->branch < to->intervals[at - 1].branch ||
                      (interval->branch == to->intervals[at - 1].branch && interval->start < to->intervals[at - 1].start))) {
        if (at < to->capacity) to->intervals[at] = to->intervals[at - 1];
        at--;
    }
    if (at < to->capacity) to->intervals[at] = *interval;
}

/* Enter what lies between the start of a row and the stop of another one, further along by a period; in parts of at
 * most a turn. */
static void enter(output *to, int first, int last, double period) {
    const problem *of = to->of;
    const double *a = &to->rows[JACOKIN_INTERVAL_COLUMNS * first], *b = &to->rows[JACOKIN_INTERVAL_COLUMNS * last];
    double start = a[START + of->parameter], stop = fmax(start, b[STOP + of->parameter] + (first == last ? 0.0 : period));
    int is_line = a[ARC] <= LINE;
    for (int more = 1; more;) {
        jacokin_ik_interval interval;
        double end = stop, turns = of->closed ? -TURN * floor((start + PI) / TURN) : 0.0;
        more = stop - start > TURN + SAME_PARAMETER;
        if (more) end = start + TURN;
        interval.start = start + turns;
        interval.stop = end + turns;
        interval.branch = (int)(is_line ? LINE - a[ARC] : a[ARC]);
        interval.rows[0] = first;
        interval.rows[1] = last;
        interval.shift[0] = -turns;
        interval.shift[1] = period;
        fill_end(&interval, 0, a[CODES], is_line);
        fill_end(&interval, 1, b[CODES + 1], is_line);
        if (start > a[START + of->parameter]) interval.ends[0] = JACOKIN_IK_END_CIRCLE, interval.joints[0] = -1;
        if (more) interval.ends[1] = JACOKIN_IK_END_CIRCLE, interval.joints[1] = -1;
        insert(to, &interval);
        start = end;
    }
}

/* Whether both ends of a row reach the target, up to limits. */
static int closes(const problem *of, const double *row) {
    double q[JACOKIN_IK_MAX_DOF];
    for (int side = 0; side < 2; side++) {
        const double *x = &row[side ? STOP : START];
        if (!settle(of->solver, of->T, of->axis, of->parameter, x, x, q)) return 0;
    }
    return 1;
}

/* How far a closed arc goes round [rad]; 0 for one that is not closed. */
static double period_of(const problem *of, int64_t arc) {
    const int64_t *row = &of->table[CURVES_arcs_arcs].integers[4 * arc];
    const double *nodes = of->table[CURVES_arcs_nodes].numbers;
    if (row[2] != JACOKIN_SEAM_END) return 0.0;
    double way = nodes[14 * (row[1] - 1) + of->parameter] - nodes[14 * row[0] + of->parameter];
    return TURN * rint(way / TURN);
}

/* Enter the pieces that the kernel found, those of a closed curve joined where it closes. */
static void enter_pieces(output *to, int pieces, int *complete) {
    const problem *of = to->of;
    for (int i = 0; i < pieces;) {
        const double *rows = &to->rows[JACOKIN_INTERVAL_COLUMNS * i];
        int n = 1;
        while (i + n < pieces && rows[JACOKIN_INTERVAL_COLUMNS * n + ARC] == rows[ARC]) n++;
        double period = period_of(of, (int64_t)rows[ARC]);
        int seam = -1 - JACOKIN_SEAM_END;
        int joined = n > 1 && period != 0.0 && rows[CODES] == seam &&
                     rows[JACOKIN_INTERVAL_COLUMNS * (n - 1) + CODES + 1] == seam;
        for (int k = joined; k < n; k++) {
            int last = joined && k == n - 1 ? 0 : k;
            if (closes(of, &rows[JACOKIN_INTERVAL_COLUMNS * k]) && closes(of, &rows[JACOKIN_INTERVAL_COLUMNS * last]))
                enter(to, i + k, i + last, period);
            else
                *complete = 0;
        }
        i += n;
    }
}

int jacokin_ik_intervals(const jacokin_ik_solver *solver, const double *target, const jacokin_ik_axis *about, void *work,
                         size_t work_size, jacokin_ik_interval *intervals, int capacity, int *count, int *complete) {
    if (solver == NULL || target == NULL || count == NULL || capacity < 0 || (intervals == NULL && capacity > 0))
        return JACOKIN_IK_BAD_ARGUMENT;
    *count = 0;
    if (complete != NULL) *complete = 0;
    layout memory;
    problem of;
    int status = read_problem(solver, target, about, work, work_size, &memory, &of);
    if (status != JACOKIN_IK_OK) return status;
    double *rows = of.table[CURVES_cuts_intervals].numbers;
    output to = {&of, rows, intervals, capacity, 0};
    int branches, whole;
    if (of.sign != 0.0) {
        int lines = find_lines(&of, memory.targets, rows, &branches, &whole);
        prepare(&of, JACOKIN_FIND_INTERVALS); /* jacokin_ik_at reads the target there */
        for (int i = 0; i < lines; i++) enter(&to, i, i, 0.0);
    } else {
        int pieces = find_pieces(&of, &whole);
        branches = (int)of.table[CURVES_arcs_size].integers[1];
        enter_pieces(&to, pieces, &whole);
    }
    *count = to.count;
    if (complete != NULL) *complete = whole;
    if (to.count > capacity) return JACOKIN_IK_NO_ROOM;
    if (to.count > 0) return JACOKIN_IK_OK;
    if (!whole) return JACOKIN_IK_NO_CONVERGENCE;
    return branches == 0 ? JACOKIN_IK_UNREACHABLE : JACOKIN_IK_OUTSIDE_LIMITS;
}

/* --- A point of an interval ------------------------------------------------------------------------------------ */

/* Find the point (7) of an arc where the curve's own parameter has a value. */
static int point_of_arc(entry *table, int parameter, const int64_t *arc, double p, double *x) {
    const double *nodes = table[CURVES_arcs_nodes].numbers;
    int64_t low = arc[0], high = arc[1] - 1; /* nodes on both sides of p */
    while (high - low > 1) {
        int64_t middle = low + (high - low) / 2;
        if (nodes[14 * middle + parameter] <= p) low = middle;
        else high = middle;
    }
    memcpy(table[CURVES_chord].numbers, &nodes[14 * low], 28 * sizeof(double));
    table[CURVES_at].numbers[0] = p;
    table[CURVES_options].integers[0] = JACOKIN_FIND_AT_PARAMETER;
    if (jacokin_run_curves(table) == 1) {
        memcpy(x, table[CURVES_x].numbers, 7 * sizeof(double));
        return 1;
    }
    for (int side = 0; side < 2; side++) { /* where the parameter stays the same along the curve, any point will do */
        const double *node = &nodes[14 * (side ? high : low)];
        if (fabs(node[parameter] - p) <= SAME_PARAMETER) {
            memcpy(x, node, 7 * sizeof(double));
            return 1;
        }
    }
    return 0;
}

int jacokin_ik_at(const jacokin_ik_solver *solver, void *work, size_t work_size, const jacokin_ik_interval *interval,
                  double p, const double *seed, double *q) {
    if (solver == NULL || interval == NULL || q == NULL) return JACOKIN_IK_BAD_ARGUMENT;
    layout memory;
    double start[JACOKIN_IK_MAX_DOF], x[7];
    int status = jacokin_lay_out(solver, work, work_size, JACOKIN_IK_INTERVALS, &memory);
    if (status == JACOKIN_IK_OK) status = jacokin_read_seed(solver, seed, start);
    if (status == JACOKIN_IK_OK && !isfinite(p)) status = JACOKIN_IK_NOT_FINITE;
    if (status != JACOKIN_IK_OK) return jacokin_no_answer(solver, q, status);
    entry *table = memory.curves;
    int parameter = solver->dof == 6 ? FREE_AXIS : JOINT_3;
    for (int side = 0; side < 2; side++)
        if (interval->rows[side] < 0 || interval->rows[side] >= JACOKIN_INTERVALS)
            return jacokin_no_answer(solver, q, JACOKIN_IK_BAD_ARGUMENT);
    if (p < interval->start || p > interval->stop) {
        p += TURN * rint((0.5 * (interval->start + interval->stop) - p) / TURN);
        if (!(interval->start - SAME_PARAMETER <= p && p <= interval->stop + SAME_PARAMETER))
            return jacokin_no_answer(solver, q, JACOKIN_IK_BAD_ARGUMENT);
        p = fmin(fmax(p, interval->start), interval->stop);
    }
    const double *rows = table[CURVES_cuts_intervals].numbers;
    const double *first = &rows[JACOKIN_INTERVAL_COLUMNS * interval->rows[0]];
    const double *last = &rows[JACOKIN_INTERVAL_COLUMNS * interval->rows[1]];
    double along = p + interval->shift[0], past = first == last ? 0.0 : interval->shift[1];
    if (first[ARC] <= LINE) {
        memcpy(x, &first[START], sizeof x);
        x[5] += first[FIRST] * (p - first[START + FREE_AXIS]);
        x[FREE_AXIS] = p;
    } else if (along <= first[START + parameter]) {
        memcpy(x, &first[START], sizeof x);
    } else if (along >= last[STOP + parameter] + past) {
        memcpy(x, &last[STOP], sizeof x);
    } else {
        if (!(first[ARC] >= 0.0 && first[ARC] < JACOKIN_ARCS)) /* memory that no intervals were found in */
            return jacokin_no_answer(solver, q, JACOKIN_IK_BAD_ARGUMENT);
        const int64_t *nodes = &table[CURVES_arcs_arcs].integers[4 * (int64_t)first[ARC]];
        if (!(nodes[0] >= 0 && nodes[0] < nodes[1] - 1 && nodes[1] <= JACOKIN_NODES))
            return jacokin_no_answer(solver, q, JACOKIN_IK_BAD_ARGUMENT);
        if (past > 0.0 && along > table[CURVES_arcs_nodes].numbers[14 * (nodes[1] - 1) + parameter]) along -= past;
        if (!point_of_arc(table, parameter, nodes, along, x))
            return jacokin_no_answer(solver, q, JACOKIN_IK_NO_CONVERGENCE);
    }
    double axis[3];
    memcpy(axis, table[CURVES_six_axis].numbers, sizeof axis);
    if (!settle(solver, table[CURVES_T].numbers, axis, parameter, x, start, q))
        return jacokin_no_answer(solver, q, JACOKIN_IK_NO_CONVERGENCE);
    return JACOKIN_IK_OK;
}

/* --- The nearest member ---------------------------------------------------------------------------------------- */

/* Joints with limits of more than a turn, of which one is nearer to the seed than half a turn: copies of some angles are
 * then more than half a turn away. The curve is searched with each such joint within half a turn of the seed, and then
 * beyond. */
typedef struct {
    int count, joints[JACOKIN_IK_MAX_DOF];
    double near[JACOKIN_IK_MAX_DOF][2], beyond[JACOKIN_IK_MAX_DOF][2]; /* [rad] */
} wide_joints;

static wide_joints find_wide_joints(const jacokin_ik_solver *solver, const double *seed) {
    wide_joints wide = {.count = 0};
    for (int j = 0; j < solver->dof; j++) {
        double lower = solver->lower[j], upper = solver->upper[j], below = seed[j] - PI, above = seed[j] + PI;
        if (is_bounded(solver, j) || (lower <= below && above <= upper)) continue;
        int n = wide.count++;
        wide.joints[n] = j;
        wide.near[n][0] = fmax(lower, below);
        wide.near[n][1] = fmin(upper, above);
        wide.beyond[n][0] = lower > below ? above : fmax(lower, upper - TURN);
        wide.beyond[n][1] = lower > below ? fmin(upper, lower + TURN) : below;
    }
    return wide;
}

/* Fill in what a search for the nearest point reads; bits of `beyond` are wide joints beyond half a turn. */
static void prepare_nearest(const problem *of, const double *seed, const wide_joints *wide, int beyond) {
    entry *table = of->table;
    double *limits = table[CURVES_nearest_limits].numbers;
    memcpy(limits, table[CURVES_cuts_limits].numbers, 14 * sizeof(double));
    for (int n = 0; n < wide->count; n++) {
        const double *range = beyond >> n & 1 ? wide->beyond[n] : wide->near[n];
        limits[wide->joints[n]] = range[0];
        limits[7 + wide->joints[n]] = range[1];
    }
    for (int j = 0; j < 7; j++) {
        table[CURVES_nearest_weights].numbers[j] = j < of->solver->dof ? 1.0 : 0.0;
        table[CURVES_nearest_seed].numbers[j] = j < of->solver->dof ? seed[j] : 0.0;
    }
}

/* Whether something may be nearer than the best so far (squared) with so many wide joints beyond half a turn. */
static int is_worth_it(int beyond, double best) {
    int joints = 0;
    for (; beyond > 0; beyond >>= 1) joints += beyond & 1;
    return PI * PI * joints < best;
}

/* Keep a point (7) that reaches the target if it is nearer to the seed than the best one so far. */
static void offer(const problem *of, const double *seed, const double *x, double *best, double *q, double *parameter) {
    double settled[JACOKIN_IK_MAX_DOF], square = 0.0;
    if (!settle(of->solver, of->T, of->axis, of->parameter, x, seed, settled)) return;
    for (int j = 0; j < of->solver->dof; j++) square += (settled[j] - seed[j]) * (settled[j] - seed[j]);
    if (!(square < *best)) return;
    *best = square;
    memcpy(q, settled, (size_t)of->solver->dof * sizeof(double));
    *parameter = of->parameter == JOINT_3 ? settled[JOINT_3] : x[FREE_AXIS];
}

/* Search a piece of a curve: a run of nodes, whose ends are those of the piece meanwhile. */
static void search_piece(const problem *of, const double *row, const double *seed, double *best, double *q,
                         double *parameter) {
    entry *table = of->table;
    double *nodes = table[CURVES_arcs_nodes].numbers;
    int64_t first = (int64_t)row[FIRST], last = (int64_t)row[LAST] + 1;
    double kept[28];
    memcpy(kept, &nodes[14 * first], 14 * sizeof(double));
    memcpy(kept + 14, &nodes[14 * last], 14 * sizeof(double));
    memcpy(&nodes[14 * first], &row[START], 7 * sizeof(double));
    memcpy(&nodes[14 * last], &row[STOP], 7 * sizeof(double));
    table[CURVES_arcs_nodes].numbers = nodes + 14 * first;
    table[CURVES_options].integers[0] = JACOKIN_FIND_NEAREST_ON_RUN;
    table[CURVES_options].integers[2] = last - first + 1;
    jacokin_run_curves(table);
    table[CURVES_arcs_nodes].numbers = nodes;
    if (table[CURVES_nearest_best].numbers[0] < INFINITY)
        offer(of, seed, table[CURVES_nearest_x].numbers, best, q, parameter);
    offer(of, seed, &row[START], best, q, parameter);
    offer(of, seed, &row[STOP], best, q, parameter);
    memcpy(&nodes[14 * first], kept, 14 * sizeof(double));
    memcpy(&nodes[14 * last], kept + 14, 14 * sizeof(double));
}

/* The nearest member of a problem, of a seed that was checked. */
static int nearest_member(const problem *of, layout *memory, const double *seed, double *q, double *parameter) {
    entry *table = of->table;
    double best = INFINITY, *rows = table[CURVES_cuts_intervals].numbers;
    int branches, whole;
    if (of->sign != 0.0) {
        int lines = find_lines(of, memory->targets, rows, &branches, &whole);
        for (int i = 0; i < lines; i++) { /* joint 6 goes to the seed's, or as near to it as it may */
            const double *row = &rows[JACOKIN_INTERVAL_COLUMNS * i];
            double start = row[START + FREE_AXIS], stop = row[STOP + FREE_AXIS], x[7];
            double wanted = start + of->sign * (seed[5] - row[START + 5]);
            wanted += TURN * rint((0.5 * (start + stop) - wanted) / TURN);
            double candidates[3] = {fmin(fmax(wanted, start), stop), start, stop};
            for (int k = 0; k < 3; k++) {
                memcpy(x, &row[START], sizeof x);
                x[5] += of->sign * (candidates[k] - start);
                x[FREE_AXIS] = candidates[k];
                offer(of, seed, x, &best, q, parameter);
            }
        }
    } else {
        const wide_joints wide = find_wide_joints(of->solver, seed);
        const int64_t *counts = table[CURVES_counts].integers;
        int sure = 1;
        for (int beyond = 0; sure && beyond < 1 << wide.count; beyond++) {
            if (!is_worth_it(beyond, best)) continue;
            prepare(of, JACOKIN_FIND_NEAREST);
            prepare_nearest(of, seed, &wide, beyond);
            sure = jacokin_run_curves(table) == 1 && counts[1] == 0 && counts[2] == 0;
            if (sure && table[CURVES_nearest_best].numbers[0] < INFINITY)
                offer(of, seed, table[CURVES_nearest_x].numbers, &best, q, parameter);
        }
        if (sure && best < INFINITY) return JACOKIN_IK_OK;
        int pieces = find_pieces(of, &whole);
        branches = (int)table[CURVES_arcs_size].integers[1];
        for (int beyond = 0; beyond < 1 << wide.count; beyond++) {
            if (!is_worth_it(beyond, best)) continue;
            prepare_nearest(of, seed, &wide, beyond);
            for (int i = 0; i < pieces; i++)
                search_piece(of, &rows[JACOKIN_INTERVAL_COLUMNS * i], seed, &best, q, parameter);
        }
    }
    if (best < INFINITY) return JACOKIN_IK_OK;
    if (!whole) return JACOKIN_IK_NO_CONVERGENCE;
    return branches == 0 ? JACOKIN_IK_UNREACHABLE : JACOKIN_IK_OUTSIDE_LIMITS;
}

int jacokin_nearest_member(const jacokin_ik_solver *solver, const double *T, const double *seed, layout *memory,
                           double *q) {
    problem of = {.solver = solver, .range = {-PI, PI}, .parameter = JOINT_3, .closed = 1, .table = memory->curves};
    double parameter;
    memcpy(of.T, T, sizeof of.T);
    int status = nearest_member(&of, memory, seed, q, &parameter);
    return status == JACOKIN_IK_OK ? status : jacokin_no_answer(solver, q, status);
}

int jacokin_ik_nearest_about(const jacokin_ik_solver *solver, const double *target, const jacokin_ik_axis *about,
                             const double *seed, void *work, size_t work_size, double *q, double *parameter) {
    if (solver == NULL || target == NULL || q == NULL) return JACOKIN_IK_BAD_ARGUMENT;
    layout memory;
    problem of;
    double start[JACOKIN_IK_MAX_DOF], p = NAN;
    int status = read_problem(solver, target, about, work, work_size, &memory, &of);
    if (status == JACOKIN_IK_OK) status = jacokin_read_seed(solver, seed, start);
    if (status == JACOKIN_IK_OK) status = nearest_member(&of, &memory, start, q, &p);
    if (status != JACOKIN_IK_OK) jacokin_no_answer(solver, q, status);
    if (status == JACOKIN_IK_OK && of.parameter == FREE_AXIS) /* in the copy that is in the range */
        p += TURN * rint((0.5 * (of.range[0] + of.range[1]) - p) / TURN);
    if (parameter != NULL) *parameter = status == JACOKIN_IK_OK ? p : NAN;
    return status;
}
