"""Common parts of web pages: downloaded components, our own modules, and the local server.

- `parts`: three.js and ECharts, downloaded once like the detector's weights.
- `modules`: scene.js, film.js, curves.js and style.css; the head of a page that loads or embeds them.
- `motion_data`: the JSON object that the modules draw.
- `serve`: a server for this machine only.
- `camera_page`: clicking marks on the floor, for `gait camera --page`.
"""
