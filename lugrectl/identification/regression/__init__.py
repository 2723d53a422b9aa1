"""The robust regression of torque on motion that every candidate shares."""
