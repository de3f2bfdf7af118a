"""Tasks that share a scene and a goal, a module for each family. Read `reach` first."""
