"""What every room uses: errors, checks of arguments, progress, how results show themselves."""
