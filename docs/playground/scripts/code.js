import { position, toRpy } from "./matrices.js";

/** The state of the page as a program. A state: `{ robot, own, dof, q, pose, free }`. */

const DIRECTIONS = { x: "1, 0, 0", y: "0, 1, 0", z: "0, 0, 1" };

const OWN = "# The file of the arm itself; add the tool and the limits that jacokin export-c was told.\n";

const listed = (values) => Array.from(values, (value) => String(Number(value.toFixed(12)))).join(", ");

export function toPython({ robot, own, dof, q, pose, free }) {
  const curves = dof === 7 || free;
  const found = curves
    ? "for interval in solver.solve_all(target).intervals:\n    print(interval.start, interval.stop, interval.ends)"
    : "branches = solver.solve_all(target, seed=seed)\nprint(branches.q, branches.within_limits, branches.margin)";
  const about = free ? `target = jacokin.FreeAxis(target, axis=(${DIRECTIONS[free]}))\n` : "";
  return `import jacokin

${own ? OWN : ""}robot = jacokin.load_robot(${loaded(robot, own)})
solver = jacokin.IKSolver(robot, collision="ignore")
target = jacokin.pose(
    [${listed(position(pose))}],  # [m]
    rpy=[${listed(toRpy(pose))}],  # [rad]
)
${about}seed = [${listed(q)}]  # [rad]

result = solver.solve(target, seed=seed)
print(result.status, result.q)

${found}
`;
}

/** Of an arm of the reader's own, only its solver file is known. */
const loaded = (robot, own) => {
  const ends = own && `base="${own.base}", tip="${own.tip}"`;
  return own ? `"${stem(robot)}.urdf", ${ends}` : `"${robot}"`;
};

const stem = (robot) => robot.replace(/\.jacokin$/, "");

export function toC({ robot, own, dof, q, pose, free }) {
  const curves = dof === 7 || free;
  const rows = [0, 4, 8, 12].map((row) => listed(pose.slice(row, row + 4))).join(",\n                           ");
  return `/* jacokin export-c ${own ? `${stem(robot)}.urdf --base ${own.base} --tip ${own.tip}` : robot} --output arm
   cc program.c $(jacokin export-c --cflags) -o program */
#include <stdio.h>
#include <stdlib.h>

#include "jacokin_ik.h"

int main(void) {
    jacokin_ik_solver *solver;
    int status = jacokin_ik_load("arm/${stem(robot)}.jacokin", &solver);
    if (status != JACOKIN_IK_OK) return puts(jacokin_ik_status_text(status)), 1;
    size_t size = jacokin_ik_work_size(solver, ${curves ? "JACOKIN_IK_INTERVALS" : "JACOKIN_IK_POSES"});
    void *work = malloc(size);

    double target[16] = {${rows}}; /* [m] */
    double seed[${dof}] = {${listed(q)}}; /* [rad] */
${curves ? cIntervals(dof, free) : cBranches(dof)}
    free(work);
    jacokin_ik_free(solver);
    return 0;
}
`;
}

const cBranches = (dof) => `    jacokin_ik_branch found[JACOKIN_IK_MAX_BRANCHES];
    int count, complete;
    status = jacokin_ik_all(solver, target, seed, work, size, found, JACOKIN_IK_MAX_BRANCHES, &count, &complete);
    puts(jacokin_ik_status_text(status));
    for (int i = 0; i < count; i++) {
        printf(found[i].success ? "within the limits:" : "outside the limits:");
        for (int joint = 0; joint < ${dof}; joint++) printf(" %.9f", found[i].q[joint]);
        puts("");
    }
`;

const cIntervals = (dof, free) => `${
  free ? `    jacokin_ik_axis about = {{${DIRECTIONS[free]}}, {-3.141592653589793, 3.141592653589793}};\n` : ""
}    double q[${dof}], parameter;
    status = jacokin_ik_nearest_about(solver, target, ${free ? "&about" : "NULL"}, seed, work, size, q, &parameter);
    puts(jacokin_ik_status_text(status));
    if (status == JACOKIN_IK_OK) {
        printf("at %.9f rad:", parameter);
        for (int joint = 0; joint < ${dof}; joint++) printf(" %.9f", q[joint]);
        puts("");
    }
`;
