"""The package as colcon installs it: its launch file, its entry in ament's index, and nothing else."""

from setuptools import setup

NAME = "fogwatch_agent"

setup(
    name=NAME,
    version="1.1.0",
    description="Starts the fogwatch agent of one robot",
    license="Apache-2.0",
    packages=[NAME],
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
        (f"share/{NAME}/launch", ["launch/agent.launch.py"]),
    ],
    install_requires=["setuptools"],
    zip_safe=True,
)
