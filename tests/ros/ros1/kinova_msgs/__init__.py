"""Messages of kinova-ros."""
