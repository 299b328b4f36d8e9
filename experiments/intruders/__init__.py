"""The moving intruder, which watches a patrol, predicts it, and plans a way in."""
