"""What `plan_path` is made of; read `plan` first, then `search`."""
