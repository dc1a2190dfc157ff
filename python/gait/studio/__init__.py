"""The interactive tool of Leventon and Freeman (1998), section 4, as a local web page.

- `source`: what is corrected: film, keypoints, camera, and the folder beside the film.
- `curves`: angles, phase, and where the motion is uncertain.
- `refine`: the whole motion solved in a process of its own.
- `session`: corrections, undo and redo, saved as they are made; parts of the motion solved again.
- `server`: routes of the page; page.html, studio.js and studio.css are the page.
"""
