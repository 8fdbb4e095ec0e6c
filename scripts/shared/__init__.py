"""What every tool uses: commands and their versions, whole files, tables, figures, progress."""
