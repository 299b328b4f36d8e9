exec(open("trial/var.py").read())
import os
import agent.policies.stochastic as S
for k,v in os.environ.items():
    if k.startswith("S_"): setattr(S,k[2:],type(getattr(S,k[2:]))(float(v)))
import runpy,sys
sys.argv[0]="fogwatch"
runpy.run_module("fogwatch",run_name="__main__")
