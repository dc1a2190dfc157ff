"""Learning a cyclic model of motion from recordings (Ormoneit and others 2000, sections 3.1-3.3).

The folders stand in this order, and each imports only those above it here:

- `mocap`: motion capture files as arrays; marker sets and marker maps.
- `solve`: arrays as bodies: skeleton fits to markers and joints, joint angles, limb lengths.
- `cycles`: bodies as cycles: steady part, period, verdict, alignment, resampling.
- `prior`: cycles as a cyclic model: missing entries, principal components, sections of the blob.
- `segments`: bodies as a prior over short segments of marker motion.
- `corpus`: the files of a run and their preparation in processes or on a cluster.
- `report`: figures and page of a learned model.

Modules beside the folders (`options`, `rotations`, `spool`) are below all of them.
"""
