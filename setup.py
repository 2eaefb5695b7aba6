"""What pyproject.toml cannot say: the missions travel in the wheel, as the package `rebound_missions`."""

from setuptools import find_namespace_packages, setup

setup(
    packages=[*find_namespace_packages(include=["companion*", "sim_vehicle*", "rebound_cli*"]), "rebound_missions"],
    package_dir={"rebound_missions": "missions"},
    package_data={
        "rebound_missions": ["*.yaml", "*.json"],
        "sim_vehicle.airframes": ["*.yaml"],
        "sim_vehicle.parameters": ["*.csv"],
    },
)
