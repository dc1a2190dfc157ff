"""Learning a cyclic model and a segment prior from motion capture (Ormoneit and others 2000, section 3).

`run` is one run: read, solve, cycle, fit, write.  The parts are in this order, and each imports only from
those above it:

- `arrays`, `rotations`: arrays on disk; rotation matrices of sequences.
- `mocap`: motion capture files as arrays; marker sets and marker maps.
- `options`: the options of a run, created once and passed down.
- `solve`: arrays as bodies: skeleton fits to markers and joints, joint angles, lengths, pelvis motion.
- `cycles`: bodies as cycles: steady part, period, verdict, alignment, cutting.
- `prior`: cycles as the cyclic model: missing entries, principal components, sections of the blob.
- `segments`: bodies as the prior over short segments of marker motion.
- `corpus`: the files of a run, read and prepared in processes or on a cluster.
- `report`: figures, text and page of a learnt model.
- `run`.
- `classes`: one run for each class of motion, and all of them in one blob.
"""
