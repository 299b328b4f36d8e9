import os
import agent.policies.plan as P
for k,v in os.environ.items():
    if k.startswith("P_"): setattr(P,k[2:],type(getattr(P,k[2:]))(float(v)))
