"""One module per format that recognises, reads and writes it; opening.READERS lists them."""
