"""Read the files of a run into a History: the bytes of the files, their contents, and the selected energy."""
