"""Recordings as bodies: fits of the skeleton to markers and joints, joint angles, lengths, pelvis motion."""
