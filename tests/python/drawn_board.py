"""Pictures of a board as a known lens would show them, from where each pixel's ray meets the board."""

import cv2
import numpy as np

from gait.camera.board import OURS

SQUARE = 64  # pixels of the texture
BORDER = 1.0  # squares of white paper around the board


def texture(board=OURS):
    """The printed sheet."""
    across, down = board.squares
    size = round((down + 2 * BORDER) * SQUARE), round((across + 2 * BORDER) * SQUARE)
    sheet = np.full(size, 235, np.uint8)
    for x, y, width, height in (board.rectangles() + [BORDER, BORDER, 0, 0]) * SQUARE:
        sheet[round(y) : round(y + height), round(x) : round(x + width)] = 25
    return cv2.GaussianBlur(sheet, (0, 0), 1.0)


def poses(count, board=OURS, seed=1, tilt=35.0, far=(1.6, 3.2)):
    """Rotation vectors and translations (squares): every part of the picture, tilted to all sides."""
    rng = np.random.default_rng(seed)
    across, down = board.squares
    for k in range(count):
        about = 2 * np.pi * k / count * 3.3
        turn = np.radians(tilt) * (0.3 + 0.7 * rng.random()) * np.array([np.cos(about), np.sin(about), 0])
        turn[2] = rng.uniform(-0.4, 0.4)
        R = cv2.Rodrigues(turn)[0]
        distance = across * rng.uniform(*far) * 0.75
        place = np.array([0.42 * np.cos(2.4 * k), 0.26 * np.sin(2.4 * k), 1.0]) * distance
        middle = np.array([across / 2 - 1, down / 2 - 1, 0])
        yield turn, place - R @ middle


def picture(camera, turn, shift, board=OURS, sheet=None, smear=(0.0, 0.0), noise=2.0, seed=0):
    """Grey picture; the lens is that of `camera`, the board's inner corners are at whole numbers of squares.

    `smear`: standard deviations of a blur along u and v, pixels.
    """
    sheet = texture(board) if sheet is None else sheet
    u, v = np.meshgrid(np.arange(camera.width, dtype=float), np.arange(camera.height, dtype=float))
    pixels = np.stack([u.ravel(), v.ravel()], axis=1)
    stop = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 40, 1e-8)
    plane = cv2.undistortPointsIter(
        pixels[:, None], camera.matrix, camera.distortion, np.eye(3), np.eye(3), stop
    )[:, 0]
    R = cv2.Rodrigues(turn)[0]
    inverse = np.linalg.inv(np.column_stack([R[:, 0], R[:, 1], shift]))
    at = np.column_stack([plane, np.ones(len(plane))]) @ inverse.T
    at = at[:, :2] / at[:, 2:]
    where = ((at + 1 + BORDER) * SQUARE - 0.5).astype(np.float32).reshape(camera.height, camera.width, 2)
    grey = cv2.remap(sheet, where, None, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT, borderValue=120)
    grey = cv2.GaussianBlur(grey, (0, 0), 0.7).astype(float)
    if any(smear):
        grey = cv2.GaussianBlur(grey, (0, 0), max(smear[0], 0.1), sigmaY=max(smear[1], 0.1))
    grey += np.random.default_rng(seed).normal(0, noise, grey.shape)
    return np.clip(np.rint(grey), 0, 255).astype(np.uint8)
