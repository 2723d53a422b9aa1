"""The frequency response of an axis with friction taken out, and the gains that it allows."""
