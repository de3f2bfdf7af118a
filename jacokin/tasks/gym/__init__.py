"""The tasks as environments of Gymnasium. Read `environment` first, then `controls`."""
