"""Estimates from sweeps: rows, tangents, normals, kinks, and the envelope of the balls."""
