"""Commands, inverse kinematics and initial poses of an arm in a scene. Read `commands` first."""
