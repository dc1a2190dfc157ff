"""The interactive tool of Leventon and Freeman (1998), section 4, as a local web page.

- `source`: the input: film, keypoints, camera, and the folder beside the film.
- `keypoint_lift`, `picture_lift`: two ways to lift it, with a common interface in `shown`.
- `curves`: angles, phase, and heel strikes.
- `refine`: solves the whole motion in a separate process.
- `session`: corrections, undo and redo, saved as they are made; solves parts of the motion again.
- `server`: routes of the page; page.html, studio.js and studio.css are the page.
"""
