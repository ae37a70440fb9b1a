"""Surfaces and inference: arrays in, values out. It knows no machine, no file dialogue, no clock."""
