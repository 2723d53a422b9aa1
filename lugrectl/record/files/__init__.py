"""Files: tables of named columns from each format."""
