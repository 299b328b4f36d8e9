import sys,os
exec(open("trial/var.py").read())
import agent.policies.stochastic as S
on=S.OnPlan.next
A,B,N=int(os.environ["A"]),int(os.environ["B"]),int(os.environ["N"])
def nx(self,view,start,pursuit):
    w=on(self,view,start,pursuit)
    if self._number==N and A<=view.tick<=B:
        t=pursuit.target
        print("NEXT",view.tick,"idx",self._index,len(self._visit.trail) if self._visit else None,"pose",round(view.pose.x,2),round(view.pose.y,2),"missed",None if self._missed is None else self._missed.size,"target",t and (t.point,t.spot,t.free),"way",w is not None,"given",getattr(pursuit.given_up,'__dict__',pursuit.given_up) and len(getattr(pursuit.given_up,'until',[]) or []))
    return w
S.OnPlan.next=nx
oo=S.OnPlan.note
def no(self,view,pursuit):
    r=oo(self,view,pursuit)
    if self._number==N and A<=view.tick<=B and view.tick%4==0:
        t=pursuit.target
        print("note",view.tick,"idx",self._index,"pose",round(view.pose.x,2),round(view.pose.y,2),"free",r,"target",t and (t.point,t.spot,t.free),"bump",view.bumped,[(q,round(p.pose.x,1),round(p.pose.y,1)) for q,p in view.peers.items()])
    return r
S.OnPlan.note=no
exec(open("trial/one.py").read())
