"""What moves an arm in a scene: commands, inverse kinematics, initial poses. Read `commands` first."""
