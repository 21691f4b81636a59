(** Complex numbers as pairs of real numbers, and lemmas about finite sums. *)
From Coq Require Import Reals List Permutation Ring Lra Lia Arith.
From Lockedjoint Require Import Definitions.
Import ListNotations.
Open Scope R_scope.

Record C := mkC { re : R; im : R }.
Definition C0 := mkC 0 0.
Definition C1 := mkC 1 0.
Definition Cadd a b := mkC (re a + re b) (im a + im b).
Definition Cmul a b := mkC (re a * re b - im a * im b) (re a * im b + im a * re b).
Definition Copp a := mkC (- re a) (- im a).
Definition Csub a b := Cadd a (Copp b).
Definition Cconj a := mkC (re a) (- im a).
Definition real (x : R) := mkC x 0.

Lemma C_eq a b : re a = re b -> im a = im b -> a = b.
Proof. destruct a, b; simpl; intros; subst; reflexivity. Qed.

Lemma C_ring : ring_theory C0 C1 Cadd Cmul Csub Copp eq.
Proof. split; intros; apply C_eq; simpl; ring. Qed.
Add Ring C_ring : C_ring.

Lemma conj_mul a b : Cconj (Cmul a b) = Cmul (Cconj a) (Cconj b).
Proof. apply C_eq; simpl; ring. Qed.
Lemma conj_add a b : Cconj (Cadd a b) = Cadd (Cconj a) (Cconj b).
Proof. apply C_eq; simpl; ring. Qed.
Lemma conj_conj a : Cconj (Cconj a) = a.
Proof. apply C_eq; simpl; ring. Qed.

Definition Csum {A} (l : list A) (f : A -> C) : C := fold_right (fun a s => Cadd (f a) s) C0 l.

Section Sums.
Context {A : Type}.
Implicit Types (l : list A).

Lemma sum_ext l (f g : A -> R) : (forall a, In a l -> f a = g a) -> sum l f = sum l g.
Proof. induction l; simpl; intros H; [easy|]. rewrite H, IHl; auto. Qed.
Lemma sum_perm l k (f : A -> R) : Permutation l k -> sum l f = sum k f.
Proof. induction 1; simpl; try lra. Qed.
Lemma sum_map {B} (g : B -> A) (l : list B) (f : A -> R) : sum (map g l) f = sum l (fun b => f (g b)).
Proof. induction l; simpl; congruence. Qed.
Lemma sum_add l (f g : A -> R) : sum l (fun a => f a + g a) = sum l f + sum l g.
Proof. induction l; simpl; lra. Qed.
Lemma sum_scale l c (f : A -> R) : sum l (fun a => c * f a) = c * sum l f.
Proof. induction l; simpl; [|rewrite IHl]; ring. Qed.
Lemma sum_zero l (f : A -> R) : (forall a, In a l -> f a = 0) -> sum l f = 0.
Proof. induction l; simpl; intros H; [easy|]. rewrite H, IHl; auto; lra. Qed.
Lemma sum_nonneg l (f : A -> R) : (forall a, In a l -> 0 <= f a) -> 0 <= sum l f.
Proof.
  induction l; simpl; intros H; [lra|].
  assert (0 <= f a) by auto. assert (0 <= sum l f) by auto. lra.
Qed.
Lemma sum_app l k (f : A -> R) : sum (l ++ k) f = sum l f + sum k f.
Proof. induction l; simpl; [|rewrite IHl]; lra. Qed.

Lemma Csum_ext l (f g : A -> C) : (forall a, In a l -> f a = g a) -> Csum l f = Csum l g.
Proof. induction l; simpl; intros H; [easy|]. rewrite H, IHl; auto. Qed.
Lemma Csum_perm l k (f : A -> C) : Permutation l k -> Csum l f = Csum k f.
Proof. induction 1; simpl; try congruence. ring. Qed.
Lemma Csum_map {B} (g : B -> A) (l : list B) (f : A -> C) : Csum (map g l) f = Csum l (fun b => f (g b)).
Proof. induction l; simpl; congruence. Qed.
Lemma Csum_app l k (f : A -> C) : Csum (l ++ k) f = Cadd (Csum l f) (Csum k f).
Proof. induction l; simpl; [|rewrite IHl]; ring. Qed.
Lemma Csum_add l (f g : A -> C) : Csum l (fun a => Cadd (f a) (g a)) = Cadd (Csum l f) (Csum l g).
Proof. induction l; simpl; [|rewrite IHl]; ring. Qed.
Lemma Csum_scale l c (f : A -> C) : Csum l (fun a => Cmul c (f a)) = Cmul c (Csum l f).
Proof. induction l; simpl; [|rewrite IHl]; ring. Qed.
Lemma re_Csum l (f : A -> C) : re (Csum l f) = sum l (fun a => re (f a)).
Proof. induction l; simpl; congruence. Qed.
Lemma im_Csum l (f : A -> C) : im (Csum l f) = sum l (fun a => im (f a)).
Proof. induction l; simpl; congruence. Qed.
End Sums.

Lemma sum_swap {A B} (l : list A) (k : list B) (f : A -> B -> R) :
  sum l (fun a => sum k (f a)) = sum k (fun b => sum l (fun a => f a b)).
Proof.
  induction l; simpl.
  - symmetry; apply sum_zero; auto.
  - rewrite IHl. symmetry. apply (sum_add k (fun b => f a b) (fun b => sum l (fun a => f a b))).
Qed.

Section Products.
Context {A B K : Type}.
Lemma sum_mul (la : list A) (lb : list B) f g :
  sum la f * sum lb g = sum la (fun a => sum lb (fun b => f a * g b)).
Proof.
  induction la; simpl; [ring|]. rewrite <- IHla, sum_scale. ring.
Qed.
Lemma sum_mul_swap (l : list K) (la : list A) (lb : list B) f g :
  sum l (fun k => sum la (fun a => f a k) * sum lb (fun b => g b k))
  = sum la (fun a => sum lb (fun b => sum l (fun k => f a k * g b k))).
Proof.
  rewrite (sum_ext l _ (fun k => sum la (fun a => sum lb (fun b => f a k * g b k))))
    by (intros; apply sum_mul).
  rewrite sum_swap. apply sum_ext; intros. apply sum_swap.
Qed.
Lemma Csum_zero (l : list A) f : (forall a, In a l -> f a = C0) -> Csum l f = C0.
Proof. induction l; simpl; intros H; [easy|]. rewrite H, IHl; auto. ring. Qed.
End Products.

Section ComplexProducts.
Context {A B K : Type}.
Lemma Csum_swap (l : list A) (k : list B) (f : A -> B -> C) :
  Csum l (fun a => Csum k (f a)) = Csum k (fun b => Csum l (fun a => f a b)).
Proof.
  induction l; simpl.
  - symmetry; apply Csum_zero; auto.
  - rewrite IHl. symmetry. apply (Csum_add k (fun b => f a b) (fun b => Csum l (fun a => f a b))).
Qed.
End ComplexProducts.

Section MoreProducts.
Context {A B K : Type}.
Lemma Csum_mul (la : list A) (lb : list B) f g :
  Cmul (Csum la f) (Csum lb g) = Csum la (fun a => Csum lb (fun b => Cmul (f a) (g b))).
Proof.
  induction la; simpl; [ring|]. rewrite <- IHla, Csum_scale. ring.
Qed.
Lemma Csum_mul_swap (l : list K) (la : list A) (lb : list B) f g :
  Csum l (fun k => Cmul (Csum la (fun a => f a k)) (Csum lb (fun b => g b k)))
  = Csum la (fun a => Csum lb (fun b => Csum l (fun k => Cmul (f a k) (g b k)))).
Proof.
  rewrite (Csum_ext l _ (fun k => Csum la (fun a => Csum lb (fun b => Cmul (f a k) (g b k)))))
    by (intros; apply Csum_mul).
  rewrite Csum_swap. apply Csum_ext; intros. apply Csum_swap.
Qed.
Lemma sum_zero_each (l : list A) f :
  (forall a, In a l -> 0 <= f a) -> sum l f = 0 -> forall a, In a l -> f a = 0.
Proof.
  induction l as [|x l IH]; simpl; intros H E a [].
  - subst. assert (0 <= f a) by auto. assert (0 <= sum l f) by (apply sum_nonneg; auto). lra.
  - assert (0 <= f x) by auto. assert (0 <= sum l f) by (apply sum_nonneg; auto).
    apply IH; auto. lra.
Qed.
Lemma sum_const (l : list A) c : sum l (fun _ => c) = INR (length l) * c.
Proof. induction l; [simpl; ring|]. cbn [length]. rewrite S_INR. simpl. rewrite IHl. ring. Qed.
End MoreProducts.

(** The unit matrix *)

Lemma delta_refl i : delta i i = 1.
Proof. unfold delta. rewrite Nat.eqb_refl. reflexivity. Qed.

Lemma sum_delta n i f : (i < n)%nat -> sum (seq 0 n) (fun k => delta i k * f k) = f i.
Proof.
  assert (forall n m, ((i < m)%nat \/ (m + n <= i)%nat) -> sum (seq m n) (fun k => delta i k * f k) = 0) as Z.
  { clear n. induction n as [|n IH]; intros m H; [easy|]. simpl. rewrite IH by lia.
    unfold delta. destruct (Nat.eqb_spec i m); [lia|ring]. }
  assert (forall n m, (m <= i < m + n)%nat -> sum (seq m n) (fun k => delta i k * f k) = f i) as G.
  { clear n. induction n as [|n IH]; intros m H; [lia|]. simpl.
    destruct (Nat.eq_dec i m) as [->|D].
    - rewrite delta_refl, Z by lia. ring.
    - rewrite IH by lia. unfold delta. destruct (Nat.eqb_spec i m); [lia|ring]. }
  intros H. apply G. lia.
Qed.

Lemma delta_sym i j : delta i j = delta j i.
Proof. unfold delta. rewrite Nat.eqb_sym. reflexivity. Qed.

(** Sums of few terms, and of an initial segment *)

Lemma Csum3 f : Csum (seq 0 3) f = Cadd (f 0%nat) (Cadd (f 1%nat) (f 2%nat)).
Proof. simpl. ring. Qed.
Lemma sum3 f : sum (seq 0 3) f = f 0%nat + (f 1%nat + f 2%nat).
Proof. simpl. ring. Qed.
Lemma sum6 f : sum (seq 0 6) f = sum (seq 0 3) (fun a => f a + f (3 + a)%nat).
Proof. simpl. ring. Qed.

Lemma sum_S n f : sum (seq 0 (S n)) f = sum (seq 0 n) f + f n.
Proof. rewrite seq_S, sum_app. simpl. ring. Qed.
Lemma seq_ext n f g : (forall i, (i < n)%nat -> f i = g i) -> sum (seq 0 n) f = sum (seq 0 n) g.
Proof. intros H. apply sum_ext. intros i I. apply in_seq in I. apply H. lia. Qed.
Lemma sum_delta_r n i f : (i < n)%nat -> sum (seq 0 n) (fun k => f k * delta k i) = f i.
Proof.
  intros I. rewrite <- (sum_delta n i f I). apply sum_ext; intros k _. rewrite (delta_sym k i). ring.
Qed.
