"""The configuration within the limits that comes closest to a target; read `search` first."""
