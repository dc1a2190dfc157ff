"""Learning a cyclic model of motion from recordings (Ormoneit and others 2000, sections 3.1-3.3).

Recordings (`mocap_asf`, `mocap_bvh`) become joints (`body`), then the angles of the default skeleton
(`retarget`) and the motion of the root (`root`); `period`, `align`, `cycles` and `fpca` turn them into mean
curves and components; `model` makes the blob's sections, `fit` runs it all, `report` draws it.
"""
