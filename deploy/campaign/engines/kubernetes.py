"""A campaign as an Indexed Job of Kubernetes: rendered, to be read and applied by its user. Nothing is started here."""

from __future__ import annotations

import json
import re
from pathlib import Path

IMAGE = "lfa-campaign:latest"
CLAIM = "lfa-results"
NAME_CHARACTERS_MAX = 40


def manifest(plan: Path, shares: int, jobs: int, image: str = IMAGE) -> str:
    """Return the ConfigMap with the plan and the Job whose pod number n does share n + 1, as YAML.

    The image needs `lfa[campaign]`; the claim `lfa-results` is a volume that many pods may write.
    """
    name = re.sub(r"[^a-z0-9]+", "-", plan.stem.lower()).strip("-")[:NAME_CHARACTERS_MAX] or "plan"
    text = json.dumps(plan.read_text(encoding="utf-8"))  # a JSON text is a YAML text
    share = f"$((JOB_COMPLETION_INDEX + 1))/{shares}"
    command = json.dumps(f'exec lfa campaign /plan/plan.toml --shard "{share}" --jobs {jobs} --out /results/{name}')
    return f"""\
apiVersion: v1
kind: ConfigMap
metadata: {{name: lfa-{name}}}
data:
  plan.toml: {text}
---
apiVersion: batch/v1
kind: Job
metadata: {{name: lfa-{name}}}
spec:
  completions: {shares}
  parallelism: {shares}
  completionMode: Indexed
  backoffLimit: {shares}
  template:
    spec:
      restartPolicy: Never
      containers:
        - name: lfa
          image: {image}
          command: [sh, -c, {command}]
          resources:
            requests: {{cpu: "{jobs}"}}
          volumeMounts:
            - {{name: plan, mountPath: /plan}}
            - {{name: results, mountPath: /results}}
      volumes:
        - name: plan
          configMap: {{name: lfa-{name}}}
        - name: results
          persistentVolumeClaim: {{claimName: {CLAIM}}}
"""
