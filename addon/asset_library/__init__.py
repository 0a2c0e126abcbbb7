"""Converted maps as assets: a worker that makes .blend files of them, see `worker`."""
