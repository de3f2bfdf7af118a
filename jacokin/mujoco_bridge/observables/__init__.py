"""What is measured in a simulation, and when it is reported. Read `observable` first."""
