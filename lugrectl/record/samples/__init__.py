"""Samples: bad ones are found on the rows as recorded, and the clock is read."""
