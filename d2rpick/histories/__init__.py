"""Read the files of a run into a History: their bytes, their contents, and the selected energy."""
