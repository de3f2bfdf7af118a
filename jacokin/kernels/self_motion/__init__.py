"""Solution curves: all configurations of a chain with one joint more than a pose needs. Read `intervals` first."""
