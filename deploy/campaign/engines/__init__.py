"""Engines of others that shares of a campaign run on: Slurm by submitit, Dask, Kubernetes."""
