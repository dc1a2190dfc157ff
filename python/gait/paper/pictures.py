"""Pictures for the page: labels, and JPEG in HTML."""

from __future__ import annotations

import base64

import cv2

from gait.io.video import Image

QUALITY = 85


def labelled(picture: Image, words: str) -> Image:
    """Write words into the top left corner of a picture, with a white line to its right."""
    picture = picture.copy()
    for colour, width in (((20, 20, 20), 3), ((255, 255, 255), 1)):
        cv2.putText(picture, words, (6, 16), cv2.FONT_HERSHEY_DUPLEX, 0.42, colour, width, cv2.LINE_AA)
    picture[:, -2:] = 255
    return picture


def image(picture: Image, alt: str) -> str:
    """Return a picture as HTML."""
    jpeg = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, QUALITY])[1].tobytes()
    data = base64.b64encode(jpeg).decode("ascii")
    return f'<img style="max-width: 100%" alt="{alt}" src="data:image/jpeg;base64,{data}">'
