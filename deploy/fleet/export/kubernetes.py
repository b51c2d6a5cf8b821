"""Kubernetes: one pod a service in a namespace of the fleet's, keys as Secrets, routers reached by Services."""

from __future__ import annotations

from lfa.deploy.fleet.export.services import KEYS, PORT, USER, FleetServices, Service
from lfa.deploy.fleet.export.yaml_text import Plain, yaml_text

LOCKED_UP: dict[str, Plain] = {
    "allowPrivilegeEscalation": False,
    "readOnlyRootFilesystem": True,
    "capabilities": {"drop": ["ALL"]},
}


def kubernetes(fleet: FleetServices) -> dict[str, str]:
    """Return the files of the export by path: the manifest, and the Secrets apart from it."""
    namespace = f"lfa-{fleet.fleet}"
    secrets = [_secret(namespace, one) for one in fleet.services]
    made: list[Plain] = [
        {
            "apiVersion": "v1",
            "kind": "Namespace",
            "metadata": {"name": namespace, "labels": {"pod-security.kubernetes.io/enforce": "restricted"}},
        },
        {
            "apiVersion": "v1",
            "kind": "ConfigMap",
            "metadata": {"name": "scenario", "namespace": namespace},
            "data": {"scenario.toml": fleet.scenario},
        },
        *(_door(namespace, host) for host in fleet.hosts),
        *(_deployment(namespace, one) for one in fleet.services),
        _network(namespace),
    ]
    return {"lfa.yaml": _documents(made), "secrets.yaml": _documents(secrets)}


def _documents(made: list[Plain]) -> str:
    return "---\n".join(yaml_text(one) for one in made)


def _secret(namespace: str, one: Service) -> Plain:
    return {
        "apiVersion": "v1",
        "kind": "Secret",
        "metadata": {"name": f"keys-{one.name}", "namespace": namespace},
        "type": "Opaque",
        "stringData": one.keys,
    }


def _door(namespace: str, host: str) -> Plain:
    """Return the Service under which a router is reached: its certificate names the machine."""
    ports: list[Plain] = [
        {"name": "tls", "port": PORT, "targetPort": "tls"},
        {"name": "quic", "port": PORT, "targetPort": "quic", "protocol": "UDP"},
    ]
    return {
        "apiVersion": "v1",
        "kind": "Service",
        "metadata": {"name": host, "namespace": namespace},
        "spec": {"selector": {"app": "lfa", "router": host}, "ports": ports},
    }


def _deployment(namespace: str, one: Service) -> Plain:
    labels: dict[str, Plain] = {"app": "lfa", "part": one.name}
    if one.router:
        labels["router"] = one.host
    selector: Plain = {"matchLabels": {"app": "lfa", "part": one.name}}
    return {
        "apiVersion": "apps/v1",
        "kind": "Deployment",
        "metadata": {"name": one.name, "namespace": namespace},
        "spec": {
            "replicas": 1,
            "strategy": {"type": "Recreate"},
            "selector": selector,
            "template": {"metadata": {"labels": labels}, "spec": _pod(one)},
        },
    }


def _pod(one: Service) -> Plain:
    """Return the pod of a service. Its keys are copied, for a Secret's files cannot belong to its user alone."""
    container: dict[str, Plain] = {
        "name": "lfa",
        "image": one.image,
        "command": list(one.command),
        "resources": {"requests": {"cpu": "100m", "memory": "64Mi"}, "limits": {"memory": f"{one.memory_mib}Mi"}},
        "securityContext": LOCKED_UP,
        "volumeMounts": [{"name": "keys", "mountPath": KEYS}],
    }
    volumes: list[Plain] = [
        {"name": "secret", "secret": {"secretName": f"keys-{one.name}", "defaultMode": 0o440}},
        {"name": "keys", "emptyDir": {"medium": "Memory", "sizeLimit": "1Mi"}},
    ]
    if one.router:
        container["ports"] = [
            {"name": "tls", "containerPort": PORT},
            {"name": "quic", "containerPort": PORT, "protocol": "UDP"},
        ]
        container["readinessProbe"] = {"tcpSocket": {"port": "tls"}, "periodSeconds": 2}
    if one.scenario:
        mounts: list[Plain] = [{"name": "keys", "mountPath": KEYS}, {"name": "scenario", "mountPath": "/scenario"}]
        container["volumeMounts"] = mounts
        volumes.append({"name": "scenario", "configMap": {"name": "scenario"}})
    copy: Plain = {
        "name": "keys",
        "image": one.image,
        "command": ["sh", "-c", f"umask 077 && cp -L /secret/* {KEYS}/"],
        "resources": {"limits": {"memory": "32Mi"}},
        "securityContext": LOCKED_UP,
        "volumeMounts": [{"name": "secret", "mountPath": "/secret"}, {"name": "keys", "mountPath": KEYS}],
    }
    return {
        "automountServiceAccountToken": False,
        "terminationGracePeriodSeconds": 5,
        "securityContext": {
            "runAsNonRoot": True,
            "runAsUser": USER,
            "fsGroup": USER,
            "seccompProfile": {"type": "RuntimeDefault"},
        },
        "initContainers": [copy],
        "containers": [container],
        "volumes": volumes,
    }


def _network(namespace: str) -> Plain:
    """Return the policy by which routers take connections of this fleet's pods only."""
    return {
        "apiVersion": "networking.k8s.io/v1",
        "kind": "NetworkPolicy",
        "metadata": {"name": "routers", "namespace": namespace},
        "spec": {
            "podSelector": {"matchExpressions": [{"key": "router", "operator": "Exists"}]},
            "policyTypes": ["Ingress"],
            "ingress": [{"from": [{"podSelector": {"matchLabels": {"app": "lfa"}}}]}],
        },
    }
