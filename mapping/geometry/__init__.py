"""Geometry: meshes, the contact of a ball, curvature, and closed-form traces."""
