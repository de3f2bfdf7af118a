"""Every tolerance of the closed form, with its unit and the reason for its size.

"Closure" is the distance of a configuration from its target: the larger of the position error [m] and the orientation
error [rad], by forward kinematics on the model's own joint placements.
"""

from __future__ import annotations

# The structure of the arm (geometry)

#: [m] and [rad]; how far the axes may miss the structure. Files with six-digit quaternions miss it by up to 1e-6; a
#: Newton step on the model's own kinematics removes what is left, so the answers are exact all the same.
STRUCTURE_TOLERANCE = 1e-5
#: [m]; shorter links are another mechanism, with solutions this method does not know.
SMALLEST_LENGTH = 1e-3
#: [m]; with a smaller lateral offset of the shoulder, pairs of roots of F are all but double, as for arms without one.
SMALLEST_OFFSET = 1e-4
#: [rad]; axes 4/5 and 5/6 closer to parallel than this do not meet in a usable point.
SMALLEST_TWIST = 0.05
#: [m]; B and A closer than this are one point: a spherical wrist.
SPHERICAL_TOLERANCE = 1e-5
#: [m] or [rad]; a misfit below this is rounding, and the arm fits the structure exactly.
EXACT_MISFIT = 1e-12
#: [m]; slack of the test whether A is within reach of O: far above rounding, and a candidate too many costs nothing.
REACH_SLACK = 1e-6

#: Axes of a target are off unit length and right angles by no more: rounding, twice what `model.poses` leaves as it is.
RIGID = 2e-14

# The roots of F (resultant, roots)

#: Rounding noise of F relative to the size of its terms: at most 11 units in the last place were measured against 50
#: digits, and interpolation may triple it.
NOISE = 32.0 * 2.2e-16
#: Coefficients that are zero if roots of F are known exactly, relative to all: with more, F is not divided by them.
MAX_REST = 1e-6
#: Near other roots, those of a divided F are less certain than its noise says: rounding of the target is not divided.
DIVIDED_NOISE = 16.0
#: [rad]; roots closer than this are one place for the choice of samples.
SAME_PLACE = 1e-3
#: [rad]; smaller intervals are not halved any more: Newton's method from both ends and the middle finds what is inside.
MIN_WIDTH = 1e-6
#: [rad]; intervals that are all noise are candidates up to this width; wider ones are halved first.
MAX_NOISE_WIDTH = 1e-2
#: [rad]; Newton's method for an extremum of F stops after a step this small, a quadratically larger accuracy.
EXTREMUM_STEP = 1e-5
#: [rad]; where F touches zero, the half-width of the interval it may have roots in is at least this.
SMALLEST_HALF_WIDTH = 1e-9
#: The smallest part of an interval that is split off.
SMALLEST_PART = 1e-3
#: [rad]; a single root is refined until Newton moves less than this,
ROOT_STEP = 1e-5
#: [rad]; and the next step, as the last two promise, is smaller than this.
ROOT_ERROR = 5e-8
#: On a model that misses the structure, candidates of F within this many times the misfit of zero are kept as well.
MISFIT_FACTOR = 3.0

# From a root to candidates (wrist)

#: |n| below this: axis 4 is nearly parallel to axis 1 and n / |n| magnifies the error of q5, up to 4e-4 rad at a double
#: root, so that axis 3 is also taken from its distance to O. Of 60,000 targets with axis 4 up to 0.03 rad from axis 1,
#: 37 lose a branch with 1e-3 and none with this; 0.1 finds nothing more.
SMALL_N = 3e-2
#: [m]; r below this: O is nearly on axis 5, and the sphere condition hardly depends on q5.
SMALL_R = 3e-3
#: Difference of cosines: axis 4 this close to axis 1 is started from there. Newton's method comes from farther.
NEAR_AXIS_1 = 3e-2
#: [m], and the same of a relative length: O this close to axis 5 is started from there.
NEAR_AXIS_5 = 3e-2
#: [m^2]; rounding noise of g.
G_NOISE = 1e-15
#: [m^2]; where |g| is below this, the second q5 of a root is tried too.
SMALL_G = 1e-5
#: [rad]; Newton stops after a step this small: the step is quadratically smaller than the error before it.
REFINED_STEP = 1e-9
#: [rad]; Newton's steps are cut to this size.
MAX_REFINE_STEP = 0.3
#: sin of the angle between axes 4 and 6 below which they count as aligned: q4 and q6 then turn the same axis, and any
#: q6 closes the pose to this many radians.
ALIGNED_SINE = 1e-10
#: [m^2]; a squared distance this little below zero is rounding at the edge of the workspace.
EDGE_SLACK = 1e-9

# Verification on the model (chain, pose)

#: [rad]; an angle past its limit by no more is on it, but for rounding.
LIMIT_SNAP = 1e-9
#: [m] and [rad]; the closure every branch has at least.
CLOSURE = 1e-9
#: [m] and [rad]; a Newton step on the model's own Jacobian is tried on a branch with a larger closure.
POLISHED_CLOSURE = 1e-13
#: [m] and [rad]; candidates with a larger closure are not worth such a step.
MAX_POLISH_ERROR = 2e-2
#: [m] and [rad]; a seed that misses its target by less may be beside a branch.
NEAR_SEED = 1e-2
#: [m^2] and [rad^2]; weights on the way from the seed, each so many times the one before, down to the least. With
#: that, a branch 1e-3 rad from the seed promises a closure of 1e-9, and smaller ones drown in rounding.
FIRST_SEED_WEIGHT, SEED_WEIGHT_FACTOR, LEAST_SEED_WEIGHT = 1e-4, 1e-2, 0.9e-12
#: [rad]; of branches whose distances to the seed differ by less, verification tells which is the nearest: it moves
#: those at folds and limits by some `TANGENCY_EXCESS`.
NEARLY_AS_NEAR = 2e-2
#: [rad]; steps with one weight end with one this short.
SEED_STEP = 1e-9
#: [rad]; a branch this near to the seed is not looked for once more.
SAME_AS_SEED = 1e-7
#: A branch at most so many times as far from the seed as the first step leads is the one it leads to,
ALONE_WAY = 1.1
#: and the only one, if the smallest pivot is so many times the sum of the weight and the square of the way.
ALONE_PIVOT = 10.0
#: Smaller pivots mean a singular Jacobian.
SMALLEST_PIVOT = 1e-14
#: Added to the diagonal of the normal equations, relative to its sum: directions that do not move the tool stay put,
#: and those with singular values down to 1e-5 converge in three steps.
DAMPING = 1e-13

# Folds, where two branches merge (folds)

#: [m^2]; where the determinant of the three equations is smaller, another branch may be nearer than 1e-2 rad. Singular
#: values of the Jacobian are about as large, in m or rad.
FOLD_DETERMINANT = 1e-5
#: [m]; starts that miss the three equations by more are not near enough to a fold to stop there.
MAX_FOLD_ERROR = 1e-4
#: [rad]; first distance at which the closure is sampled beside a fold. Cubic terms matter as its square.
FOLD_SAMPLE = 1e-3
#: [rad]; smallest distance of the samples: their differences, 1e-10, stand well above rounding.
SMALLEST_FOLD_SAMPLE = 1e-5
#: [rad]; a fold farther than this from the candidate is not the one that makes it singular.
MAX_FOLD_DISTANCE = 2e-2
#: [rad]; Newton's method separates branches farther than this from the fold between them.
MAX_FOLD_WIDTH = 1e-3
#: [rad^2]; F is divided by pairs of complex roots that are nearer to each other than twice its root: cubic terms move
#: others too much.
MAX_PAIR_SQUARE = 1e-4
#: [rad]; candidates this close to a fold lead to it again.
SAME_FOLD = 2e-5

# Limits (pose)

#: [rad]; at a fold, rounding may put a joint this far past its limit: about the square root of 1e-15 over the smallest
#: curvature of folds, the cube root where three branches merge, and more next to wrists that are straight just there.
TANGENCY_EXCESS = 2e-3
#: [m] and [rad]; a branch that closes so well within its limits needs not be held on them: a thousand times rounding.
TANGENCY_CLOSURE = 1e-12
#: [m] and [rad]; the closure of a branch held on its limit. Of a stretched arm 24 times the former was measured, and a
#: regular branch may be past its limit by no more than this over its smallest singular value.
HELD_CLOSURE = 3e-11

# Two branches or one (pose)

#: [rad]; branches closer than this on the circle are one.
SAME_BRANCH = 1e-6
#: At a fold, where two branches merge, errors grow with the square of the distance: everything within
#: FOLD_FACTOR * sqrt(closure) [rad] of a branch is the same double solution.
FOLD_FACTOR = 20.0
#: [rad]; branches that a joint has farther apart are two: that of closures of `CLOSURE`, by far the largest, is 6e-4.
APART = 1e-3
#: [rad]; a branch this close to a single root in joint 6 is the one that belongs to it.
SAME_ROOT = 2e-7
#: [rad]; a refined start this close to a branch in joints 1, 5 and 6 is that branch again.
SAME_START = 1e-10

# Arms of any structure (six_joints)

#: Noise of F in terms of four coefficients that would be zero without rounding: they may be smaller by chance.
TIMES_NOISE = 8.0
#: At least this part of the largest value of F is noise.
SMALLEST_NOISE = 64.0 * 2.2e-16
#: Rounding of the matrix whose determinant F is, and how often the noise of F counts where branches may touch.
NOISE_OF_M, NOISE_OF_TOUCH = 16.0 * 2.2e-16, 4.0
#: Part of F's size by which the last digits of a target move it: where it comes as near to zero it may touch it.
POSE_NOISE = 3e-13
#: Noise of Bernstein coefficients on a stretch, relative to the largest determinant there: 1e-14 of each, as much as
#: the change of basis may amplify it, 5e4.
CLOSE_NOISE = 5e-10
#: [rad]; as much again on a stretch of this half-width times 1e9: where several roots meet, each makes a determinant as
#: uncertain as rounding is beside its distance.
NARROW_NOISE = 5e-11
#: F is all noise if the sum of its coefficients is not this many times as large.
UNCERTAIN = 1e3
#: [rad]; a branch this close to a root of F in its angle, and to the root's own uncertainty, belongs to it.
SAME_THETA = 2e-6
#: The determinant of a Jacobian [m^3], of arms of about 1 m: singular below this, as a continuum of branches is.
SINGULAR_DETERMINANT = 1e-9
#: [m] and [rad]; the closure along a continuum, a few hundredths of a radian from where the test begins. Beside a fold
#: it is above the square of that.
CONTINUUM_CLOSURE = 1e-9
#: [m^3]; branches less singular than this are found on their own: their roots of F stand apart.
NEARLY_SINGULAR_DETERMINANT = 3e-4
#: [m] and [rad]; where less remains of the closure along the singular direction, a continuum nearly goes there. Beside
#: a fold more remains after the first step, 0.13 rad.
NEAR_CONTINUUM = 3e-3
#: [m] and [rad]; a structure that an arm misses by less is named; poses are solved as for any arm all the same.
EXACT_STRUCTURE = 1e-9
#: Singular values of a Jacobian, lengths in units of the arm's size: below this a freedom is missing. With less, a
#: joint that turns by a radian moves the tool within the tolerances of an answer.
SMALLEST_FREEDOM = 1e-6
#: The same of six joints without the one that is the parameter of curves: it changes along a curve by about as much,
#: and solutions that come and go within 3e-5 rad of it are not looked for.
SMALLEST_FREEDOM_OF_CURVES = 1e-4
#: In units of the arm's length; where both coefficients of an angle's equation are below this, nothing determines it.
FREE_ANGLE = 1e-10
#: Equations of one angle that miss a solution by less, in units of the arm's length and its square, are left to the
#: general way: by so much at most they may be off for what the structure misses.
NEARLY = 1e-6
#: Squares this little beyond the edge of an equation of one angle, once another is at a fold: that one is exact to
#: 3e-8 by rounding, and to 3e-5 by what the structure may miss.
EDGE_SLACK_AFTER_FOLD = 1e-6
#: Axes that may align are so near that where their angles meet is no fold: sine of what they enclose.
SMALL_SINE = 1e-3
#: In units of the arm's length, and sines: below this an arm has no such form, or one too near to another.
DISTINCT = 0.02
