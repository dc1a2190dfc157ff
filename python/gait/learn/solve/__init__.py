"""From recordings to bodies: skeleton fits to markers and joints, joint angles, lengths, pelvis motion."""
