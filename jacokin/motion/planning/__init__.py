"""What `plan_path` is made of; read `plan` first, then `ladder` and `search`."""
