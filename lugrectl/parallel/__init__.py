"""Independent jobs on threads, processes and clusters."""
