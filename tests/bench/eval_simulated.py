CASES = {}


def make(folder, update):
    pass
