"""The paper's policy: a social potential field."""
