"""Common parts of web pages: downloaded components, our own modules, and the local server.

- `parts`: three.js and ECharts, fetched once like the detector's weights.
- `modules`: scene.js, film.js, curves.js and style.css; a page's head, with them served or written into it.
- `motion_data`: the JSON object that the modules draw.
- `serve`: a server for this machine alone.
- `camera_page`: clicking marks on the floor, for `gait camera --page`.
"""
