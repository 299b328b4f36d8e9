"""The launch file of fogwatch's agent, as a package that colcon builds; fogwatch itself comes from pip."""
