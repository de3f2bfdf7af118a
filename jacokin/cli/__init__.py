"""The command line: it parses and prints, and leaves every computation to the packages below it. Read `main` first.

main, process              its subcommands, its exit codes, streams and signals
command                    commands of click whose options are fields of classes, lists of numbers among them
options, groups            options that commands have in common, alone and as classes; files that are not overwritten
units, display             radians and degrees, tables and JSON
ik, ik_answers, ik_batch   `jacokin ik`: the command, the answer to one pose, a file of poses
kinematics, info           `fk`, `jacobian`; `info`
paths                      `plan`, `track`, `move`
teleop                     `teleop`, with a terminal's keys and a task's simulation
twin, run                  `twin`, a node of ROS; `run`, which moves an arm
reachability               `map`, `place`
calibrate                  `calibrate`, with `fit` and `plan`
task, viewer               `task`; `view`
crosscheck, doctor         `crosscheck`; `doctor` and `warmup`
export_c                   `export-c`, for the C library
demo, picture              `demo`, and the picture that it draws
"""
