/* What the files of the C library have in common: the solver, work memory as tables of arrays, and kinematics.
 *
 * solver.c     making a solver, what it knows, forward kinematics
 * branches.c   every branch of a pose of six joints, and the nearest one
 * curves.c     one free parameter: intervals, points on them, the nearest one
 * wide.c       which of two forms of a kernel this processor runs
 *
 * The kernels are Python, compiled to functions that take a table of the addresses of their arrays. arrays.h is
 * written from that Python when the library is built: which arrays there are, and how long, is said there and nowhere
 * else.
 */

#ifndef JACOKIN_COMMON_H
#define JACOKIN_COMMON_H

#include <math.h>
#include <stdint.h>

#include "arrays.h"
#include "jacokin_ik.h"

#define PI 3.141592653589793
#define TURN (2.0 * PI)

/* Doubles of a solver file that its chain, constants and joints take at most. */
enum { MAX_CHAIN = (JACOKIN_IK_MAX_DOF + 1) * 12, CONSTANTS_SIX = JACOKIN_ARM_CONSTANTS, CONSTANTS_SEVEN = 12 };
struct jacokin_ik_solver {
    int dof;
    int kind;                        /* which of seven angles is the parameter: JACOKIN_AFTER, _BEFORE or _JOINT_3 */
    double chain[MAX_CHAIN];         /* (dof + 1, 3, 4) placements between joints that turn about z */
    double six[MAX_CHAIN];           /* the same, turned round where the kind is JACOKIN_BEFORE: the first six joints
                                        are solved for, unless the kind is JACOKIN_JOINT_3 */
    double constants[CONSTANTS_SIX]; /* what the kernels know about those six joints; or (12) about seven */
    double lower[JACOKIN_IK_MAX_DOF], upper[JACOKIN_IK_MAX_DOF], home[JACOKIN_IK_MAX_DOF]; /* [rad] */
    double limits[3 * 6];            /* six joints, for the kernels: lower, upper, and the snap distance */
    double snap;                     /* [rad] a joint past its limit by no more is put on it */
    double position_tolerance;       /* [m] */
    double orientation_tolerance;    /* [rad] */
    const char *names[3 + JACOKIN_IK_MAX_DOF]; /* robot, base, frame, joints */
    char *text;                      /* what they point into */
};

/* --- Work memory: a table of addresses, and the arrays themselves --------------------------------------------- */

/* Positions in the tables. An array of any length is followed by its length. */
#define TARGETS(name, numbers) TARGETS_##name,
#define TARGETS_FREE(name, numbers) TARGETS_##name, TARGETS_##name##_length,
#define SET(name, numbers) SET_##name,
#define SET_FREE(name, numbers) SET_##name, SET_##name##_length,
#define POINT(name, numbers) POINT_##name,
#define POINT_FREE(name, numbers) POINT_##name, POINT_##name##_length,
#define NEAREST(name, numbers) NEAREST_##name,
#define NEAREST_FREE(name, numbers) NEAREST_##name, NEAREST_##name##_length,
enum { JACOKIN_SOLVE_TARGETS(TARGETS, TARGETS_FREE) TARGETS_TABLE };
enum { JACOKIN_SOLVE_SET(SET, SET_FREE) SET_TABLE };
enum { JACOKIN_FIND_POINT(POINT, POINT_FREE) POINT_TABLE };
enum { JACOKIN_FIND_NEAREST(NEAREST, NEAREST_FREE) NEAREST_TABLE };

/* Every entry is 8 bytes: a double, an int64_t, or the address of some. */
typedef union {
    double *numbers;
    int64_t *integers;
    void *address;
    int64_t length;
} entry;

/* The kernels. */
int64_t jacokin_solve_targets(entry *table);
int64_t jacokin_solve_set(entry *table);
int64_t jacokin_find_point(entry *table);
int64_t jacokin_find_nearest(entry *table);

/* Those of wide.c, which Python calls, too. */
#if defined(_WIN32) || defined(__wasm__)
#define SHOWN
#else
#define SHOWN __attribute__((visibility("default")))
#endif
SHOWN int jacokin_is_wide(void);
SHOWN int64_t jacokin_solve_targets_chosen(entry *table);

/* A call's memory, laid out by jacokin_lay_out: a table for each kernel. Memory for poses only has that of targets. */
typedef struct {
    entry *targets, *set, *point, *nearest;
} layout;

/* Lay tables and arrays out in the caller's memory. JACOKIN_IK_WORK_TOO_SMALL, JACOKIN_IK_BAD_ARGUMENT. */
int jacokin_lay_out(const jacokin_ik_solver *solver, void *work, size_t work_size, enum jacokin_ik_task task,
                    layout *memory);

/* --- What is checked at the border ----------------------------------------------------------------------------- */

/* Copy a target, its rotation made orthonormal. JACOKIN_IK_NOT_FINITE, JACOKIN_IK_NOT_RIGID. */
int jacokin_read_target(const double *target, double *T);

/* Copy a seed, moved inside the limits; home for null. JACOKIN_IK_NOT_FINITE. */
int jacokin_read_seed(const jacokin_ik_solver *solver, const double *seed, double *inside);

/* --- Kinematics ------------------------------------------------------------------------------------------------ */

/* Fill the pose (16) at the end of a chain of so many joints at q. */
void jacokin_forward(const double *chain, int joints, const double *q, double *pose);

/* Fill the inverse (3, 4) of a placement (3, 4). */
void jacokin_invert(const double *placement, double *inverse);

/* Whether q reaches a target (16): within every limit exactly, and within the tolerances. Position error [m] and
 * orientation error [rad] go to errors (2) where that is not null. */
int jacokin_reaches(const jacokin_ik_solver *solver, const double *T, const double *q, double *errors);

/* The 2 pi equivalent of an angle within its limits that is nearest to it; without one, the nearer limit [rad]. */
double jacokin_into_limits(double angle, double lower, double upper);

/* Fill q with NaN, and return the status. */
int jacokin_no_answer(const jacokin_ik_solver *solver, double *q, int status);

/* --- Six joints ------------------------------------------------------------------------------------------------ */

/* Run the closed form on a target and a seed that were checked; its rows, nearest to the seed first, are then in
 * table[TARGETS_pose_branches_rows]. Returns how many there are; *dropped tells whether some may be missing. */
int jacokin_find_branches(const jacokin_ik_solver *solver, const double *T, const double *seed, entry *table,
                          int *dropped);

/* --- Seven joints ---------------------------------------------------------------------------------------------- */

/* jacokin_ik_nearest for a target and a seed that were checked. */
int jacokin_nearest_on_curves(const jacokin_ik_solver *solver, const double *T, const double *seed, const layout *memory,
                              double *q);

#endif
