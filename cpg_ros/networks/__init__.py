"""The networks: equations, symmetry, gaits, and which cell drives which leg."""
